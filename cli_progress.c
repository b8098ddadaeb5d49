#include "cli_progress.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

static const double TERMINAL_S = 0.1, LOG_S = 10;

double cli_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void cli_progress_start(cli_progress *p, bool quiet)
{
    *p = (cli_progress){
        .quiet = quiet, .terminal = isatty(STDERR_FILENO) == 1, .phase = PREP_PHASES};
    p->start = p->last = cli_clock();
}

static double resident_mib(void)
{
    unsigned long all, resident = 0;
    FILE *f = fopen("/proc/self/statm", "r");
    if (f == NULL) return 0;
    if (fscanf(f, "%lu %lu", &all, &resident) != 2) resident = 0;
    fclose(f);
    return (double)resident * (double)sysconf(_SC_PAGESIZE) / (1 << 20);
}

static bool is_due(cli_progress *p)
{
    double t = cli_clock();
    if (p->quiet || t - p->last < (p->terminal ? TERMINAL_S : LOG_S)) return false;
    p->last = t;
    return true;
}

static void show(cli_progress *p, const char *line)
{
    struct winsize window;
    int columns = 80;
    if (!p->terminal) {
        fprintf(stderr, "%s\n", line);
        return;
    }
    if (ioctl(STDERR_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 0)
        columns = window.ws_col;
    fprintf(stderr, "\r\033[K%.*s", columns - 1, line);
    fflush(stderr);
    p->shown = true;
}

static void time_left(double seconds, char text[32])
{
    unsigned long s = (unsigned long)(seconds + 0.5);
    if (s >= 3600) snprintf(text, 32, "%lu:%02lu:%02lu left", s / 3600, s / 60 % 60, s % 60);
    else snprintf(text, 32, "%lu:%02lu left", s / 60, s % 60);
}

void cli_progress_build(cli_progress *p, const prep_progress *now)
{
    char line[256], of[32] = "", share[16] = "", left[32] = "", scratch[32] = "";
    double t = cli_clock();
    if (p->phase != now->phase) {
        p->phase = now->phase;
        p->phase_start = t;
        p->phase_first = now->points;
    }
    if (!is_due(p)) return;
    double rate =
        t > p->phase_start ? (double)(now->points - p->phase_first) / (t - p->phase_start) : 0;
    if (now->points_total > 0) snprintf(of, sizeof of, " of %.1f", (double)now->points_total / 1e6);
    if (now->share >= 0) snprintf(share, sizeof share, " %3.0f %%", 100 * now->share);
    if (now->share > 0.02) time_left((t - p->start) * (1 - now->share) / now->share, left);
    if (now->scratch_bytes > 0)
        snprintf(scratch, sizeof scratch, "scratch %.0f MB   ", (double)now->scratch_bytes / 1e6);
    snprintf(line, sizeof line, "%-9s%s   %.1f%s M points   %.1f M/s   memory %.0f MiB   %s%s",
             prep_phase_name(now->phase), share, (double)now->points / 1e6, of, rate / 1e6,
             resident_mib(), scratch, left);
    show(p, line);
}

void cli_progress_share(cli_progress *p, const char *what, uint64_t done, uint64_t total)
{
    char line[128];
    if (!is_due(p)) return;
    snprintf(line, sizeof line, "%-9s %3.0f %%", what, 100 * (double)done / (double)total);
    show(p, line);
}

void cli_progress_frames(cli_progress *p, uint64_t done, uint64_t total, uint64_t drawn,
                         double seconds, uint64_t points)
{
    char line[192], left[32] = "";
    if (!is_due(p)) return;
    double rate = seconds > 0 ? (double)drawn / seconds : 0;
    if (rate > 0) time_left((double)(total - done) / rate, left);
    snprintf(line, sizeof line,
             "recording %3.0f %%   frame %" PRIu64 " of %" PRIu64
             "   %.1f frames/s   %.2f M points   %s",
             100 * (double)done / (double)total, done, total, rate, (double)points / 1e6, left);
    show(p, line);
}

void cli_progress_end(cli_progress *p)
{
    if (p->shown) fprintf(stderr, "\r\033[K");
    p->shown = false;
}
