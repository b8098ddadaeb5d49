/* tests/pcl_pcd.cpp - every PCD file of the real scans, read by us and by the Point Cloud Library:
 * the same points.
 *
 * Usage: pcl_pcd FOLDER. Files that PCL cannot read are skipped, and it is said why. */
#include "tests/pcl_ours.h"

#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>
#include <pcl/PCLPointCloud2.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <strings.h>
#include <sys/wait.h>
#include <unistd.h>

static bool read_ours(const std::string &path, std::vector<double> &xyz, std::string &reason)
{
    double *values = nullptr;
    size_t count = 0;
    char text[512];
    const bool ok = pcl_ours_read(path.c_str(), &values, &count, text, sizeof text) != 0;
    if (ok) xyz.assign(values, values + 3 * count);
    if (!ok) reason = text;
    std::free(values);
    return ok;
}

static bool read_field(const pcl::PCLPointCloud2 &cloud, const char *name, std::vector<double> &out)
{
    for (const auto &field : cloud.fields) {
        if (strcasecmp(field.name.c_str(), name) != 0) continue;
        const size_t count = static_cast<size_t>(cloud.width) * cloud.height;
        for (size_t i = 0; i < count; i++) {
            const auto *at = cloud.data.data() + i * cloud.point_step + field.offset;
            float narrow;
            double wide;
            if (field.datatype == pcl::PCLPointField::FLOAT32) {
                std::memcpy(&narrow, at, sizeof narrow);
                wide = narrow;
            } else if (field.datatype == pcl::PCLPointField::FLOAT64) {
                std::memcpy(&wide, at, sizeof wide);
            } else {
                return false;
            }
            out.push_back(wide);
        }
        return true;
    }
    return false;
}

/* PCL keeps points without coordinates, we do not. */
static void leave_out_not_finite(std::vector<double> axes[3])
{
    size_t kept = 0;
    for (size_t i = 0; i < axes[0].size(); i++) {
        if (!std::isfinite(axes[0][i]) || !std::isfinite(axes[1][i]) || !std::isfinite(axes[2][i]))
            continue;
        for (int a = 0; a < 3; a++)
            axes[a][kept] = axes[a][i];
        kept++;
    }
    for (int a = 0; a < 3; a++)
        axes[a].resize(kept);
}

static bool read_pcl(const std::string &path, std::vector<double> axes[3], std::string &reason)
{
    try {
        pcl::PCDReader reader;
        pcl::PCLPointCloud2 cloud;
        if (reader.read(path, cloud) < 0) {
            reason = "PCL refuses the file";
            return false;
        }
        const char *names[3] = {"x", "y", "z"};
        for (int a = 0; a < 3; a++) {
            if (read_field(cloud, names[a], axes[a])) continue;
            reason = std::string("PCL finds no usable field ") + names[a];
            return false;
        }
        leave_out_not_finite(axes);
        return true;
    } catch (const std::exception &e) {
        reason = std::string("PCL throws: ") + e.what();
        return false;
    }
}

/* PCL reads ascii into floats, we keep all digits: a step of the last bit of a float is no
 * difference. */
static bool is_close(double ours, double theirs)
{
    return std::fabs(ours - theirs) <= std::fabs(theirs) * 1.2e-7;
}

static bool compare(const std::vector<double> &ours, const std::vector<double> axes[3],
                    std::string &reason)
{
    if (ours.size() != 3 * axes[0].size()) {
        reason =
            std::to_string(ours.size() / 3) + " points, PCL has " + std::to_string(axes[0].size());
        return false;
    }
    for (size_t i = 0; i < axes[0].size(); i++) {
        for (int a = 0; a < 3; a++) {
            if (is_close(ours[3 * i + a], axes[a][i])) continue;
            reason = "point " + std::to_string(i) + " axis " + "xyz"[a] + ": " +
                     std::to_string(ours[3 * i + a]) + ", PCL has " + std::to_string(axes[a][i]);
            return false;
        }
    }
    return true;
}

/* Files that PCL reads otherwise, and why we do not follow it. */
static const char *known_difference(const std::string &file)
{
    if (file.find("utm17_comma") != std::string::npos)
        return "PCL takes no commas between numbers, and reads zeros";
    return nullptr;
}

enum verdict { SAME = 0, DIFFERENT = 1, SKIPPED = 2 };

static verdict judge(const std::string &file, bool is_ours, const std::vector<double> &ours,
                     std::string reason)
{
    std::vector<double> axes[3];
    const std::string name = std::filesystem::path(file).filename().string();
    const std::string our_reason = reason;
    if (!read_pcl(file, axes, reason) || (!is_ours && axes[0].empty())) {
        std::printf("skip %s: %s\n", name.c_str(), reason.c_str());
        return SKIPPED;
    }
    if (is_ours && known_difference(file) != nullptr) {
        std::printf("skip %s: %s\n", name.c_str(), known_difference(file));
        return SKIPPED;
    }
    if (is_ours && compare(ours, axes, reason)) {
        std::printf("same %s: %zu points\n", name.c_str(), axes[0].size());
        return SAME;
    }
    std::printf("DIFFERENT %s: %s\n", name.c_str(), is_ours ? reason.c_str() : our_reason.c_str());
    return DIFFERENT;
}

/* Under the address sanitizer too, a crash of PCL shall be a signal that ends its process. */
extern "C" const char *__asan_default_options(void);
extern "C" const char *__asan_default_options(void)
{
    return "handle_segv=0:handle_abort=0:handle_sigbus=0";
}

/* PCL crashes on some valid files, so it gets a process of its own; ours is read before, where a
 * crash would show. */
static verdict judge_apart(const std::string &file)
{
    std::vector<double> ours;
    std::string reason;
    const bool is_ours = read_ours(file, ours, reason);
    std::fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
        const verdict v = judge(file, is_ours, ours, reason);
        std::fflush(stdout);
        _exit(v);
    }
    int status = 0;
    if (child < 0 || waitpid(child, &status, 0) < 0) return DIFFERENT;
    if (WIFEXITED(status)) return static_cast<verdict>(WEXITSTATUS(status));
    std::printf("skip %s: PCL crashes (signal %d)\n", file.c_str(), WTERMSIG(status));
    return SKIPPED;
}

int main(int argc, char **argv)
{
    if (argc != 2 || !std::filesystem::is_directory(argv[1])) {
        std::printf("skipped: the real scans are not here\n");
        return 77;
    }
    pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
    std::vector<std::string> files;
    for (const auto &entry : std::filesystem::directory_iterator(argv[1])) {
        if (entry.path().extension() == ".pcd") files.push_back(entry.path().string());
    }
    std::sort(files.begin(), files.end());
    int count[3] = {0, 0, 0};
    for (const auto &file : files)
        count[judge_apart(file)]++;
    std::printf("%d passed, %d failed, %d skipped\n", count[SAME], count[DIFFERENT],
                count[SKIPPED]);
    return count[DIFFERENT] > 0 || count[SAME] == 0;
}
