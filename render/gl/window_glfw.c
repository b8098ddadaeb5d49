#include "render/gl/window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <stdlib.h>
#include <string.h>

enum { EVENTS_MAX = 256 };

struct rgl_window {
    GLFWwindow *glfw;
    char *title;                  /* owned */
    rgl_event events[EVENTS_MAX]; /* a ring; when it is full, the newest moves of the cursor are
                                     dropped first */
    uint32_t first, count;
    int windowed[4]; /* place and size before it filled the screen */
};

static void push(rgl_window *w, rgl_event event)
{
    rgl_event *last = w->count > 0 ? &w->events[(w->first + w->count - 1) % EVENTS_MAX] : NULL;
    if (last != NULL && last->kind == RGL_EVENT_MOVE && event.kind == RGL_EVENT_MOVE) {
        *last = event; /* only where the cursor is now matters */
        return;
    }
    if (w->count == EVENTS_MAX) return;
    w->events[(w->first + w->count++) % EVENTS_MAX] = event;
}

/* Cursor places come in the units of the desktop, the picture has pixels. */
static void cursor_at(const rgl_window *w, double x, double y, rgl_event *event)
{
    int width, height, pixels_x, pixels_y;
    glfwGetWindowSize(w->glfw, &width, &height);
    glfwGetFramebufferSize(w->glfw, &pixels_x, &pixels_y);
    event->x = width > 0 ? x * pixels_x / width : x;
    event->y = height > 0 ? y * pixels_y / height : y;
}

static void cursor_now(const rgl_window *w, rgl_event *event)
{
    double x, y;
    glfwGetCursorPos(w->glfw, &x, &y);
    cursor_at(w, x, y, event);
}

static void on_key(GLFWwindow *glfw, int key, int scancode, int action, int mods)
{
    (void)scancode;
    rgl_window *w = glfwGetWindowUserPointer(glfw);
    if (action == GLFW_RELEASE) return;
    rgl_event event = {.kind = RGL_EVENT_KEY,
                       .shift = (mods & GLFW_MOD_SHIFT) != 0,
                       .control = (mods & GLFW_MOD_CONTROL) != 0};
    if (key >= GLFW_KEY_A && key <= GLFW_KEY_Z) {
        /* The letter that is printed on the key, not the one that would be there in America. */
        const char *name = glfwGetKeyName(key, 0);
        bool plain = name != NULL && name[0] >= 'a' && name[0] <= 'z' && name[1] == '\0';
        event.key = plain ? name[0] - 'a' + 'A' : key - GLFW_KEY_A + 'A';
    } else if (key == GLFW_KEY_ESCAPE) {
        event.key = RGL_KEY_ESCAPE;
    } else if (key == GLFW_KEY_F1) {
        event.key = RGL_KEY_F1;
    } else {
        event.key = 0; /* keeps a held arrow key drawing */
    }
    cursor_now(w, &event);
    push(w, event);
}

static void on_character(GLFWwindow *glfw, unsigned codepoint)
{
    bool letter = (codepoint >= 'a' && codepoint <= 'z') || (codepoint >= 'A' && codepoint <= 'Z');
    if (letter || codepoint <= ' ' || codepoint > '~') return;
    push(glfwGetWindowUserPointer(glfw), (rgl_event){.kind = RGL_EVENT_KEY, .key = (int)codepoint});
}

static void on_button(GLFWwindow *glfw, int button, int action, int mods)
{
    rgl_window *w = glfwGetWindowUserPointer(glfw);
    if (button > GLFW_MOUSE_BUTTON_MIDDLE) return;
    rgl_event event = {.kind = RGL_EVENT_BUTTON,
                       .button = button == GLFW_MOUSE_BUTTON_LEFT    ? RGL_BUTTON_LEFT
                                 : button == GLFW_MOUSE_BUTTON_RIGHT ? RGL_BUTTON_RIGHT
                                                                     : RGL_BUTTON_MIDDLE,
                       .down = action == GLFW_PRESS,
                       .shift = (mods & GLFW_MOD_SHIFT) != 0};
    cursor_now(w, &event);
    push(w, event);
}

static void on_move(GLFWwindow *glfw, double x, double y)
{
    rgl_window *w = glfwGetWindowUserPointer(glfw);
    rgl_event event = {.kind = RGL_EVENT_MOVE};
    cursor_at(w, x, y, &event);
    push(w, event);
}

static void on_scroll(GLFWwindow *glfw, double dx, double dy)
{
    (void)dx;
    rgl_window *w = glfwGetWindowUserPointer(glfw);
    rgl_event event = {.kind = RGL_EVENT_SCROLL, .dy = dy};
    cursor_now(w, &event);
    push(w, event);
}

static void on_refresh(GLFWwindow *glfw)
{
    push(glfwGetWindowUserPointer(glfw), (rgl_event){.kind = RGL_EVENT_REFRESH});
}

static void on_resize(GLFWwindow *glfw, int width, int height)
{
    (void)width, (void)height;
    on_refresh(glfw);
}

static void on_close(GLFWwindow *glfw)
{
    push(glfwGetWindowUserPointer(glfw), (rgl_event){.kind = RGL_EVENT_CLOSE});
}

static void set_callbacks(rgl_window *w)
{
    glfwSetWindowUserPointer(w->glfw, w);
    glfwSetKeyCallback(w->glfw, on_key);
    glfwSetCharCallback(w->glfw, on_character);
    glfwSetMouseButtonCallback(w->glfw, on_button);
    glfwSetCursorPosCallback(w->glfw, on_move);
    glfwSetScrollCallback(w->glfw, on_scroll);
    glfwSetWindowRefreshCallback(w->glfw, on_refresh);
    glfwSetFramebufferSizeCallback(w->glfw, on_resize);
    glfwSetWindowCloseCallback(w->glfw, on_close);
}

/* With a notice of driver resets where there is one to be had. */
static GLFWwindow *open_window(const char *title, uint32_t width, uint32_t height)
{
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    glfwWindowHint(GLFW_DEPTH_BITS, 0);
    glfwWindowHint(GLFW_STENCIL_BITS, 0);
    glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_LOSE_CONTEXT_ON_RESET);
    GLFWwindow *window = glfwCreateWindow((int)width, (int)height, title, NULL, NULL);
    if (window != NULL) return window;
    glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_NO_ROBUSTNESS);
    return glfwCreateWindow((int)width, (int)height, title, NULL, NULL);
}

static bool take_window(rgl_window *w, uint32_t width, uint32_t height, mospt_err *err)
{
    const char *why = NULL;
    GLFWwindow *window = open_window(w->title, width, height);
    if (window == NULL) {
        glfwGetError(&why);
        return mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                             "no window with OpenGL 3.3 can be opened here (%s)",
                             why != NULL ? why : "the system gives no reason");
    }
    w->glfw = window;
    set_callbacks(w);
    glfwMakeContextCurrent(window);
    glfwSwapInterval(1);
    return true;
}

bool rgl_window_create(const char *title, uint32_t width, uint32_t height, rgl_window **out,
                       mospt_err *err)
{
    if (!glfwInit())
        return mospt_err_set(
            err, MOSPT_EINVAL, mospt_nowhere(),
            "no display to open a window on; `instantpoints shot` renders without one");
    rgl_window *w = calloc(1, sizeof *w);
    if (w == NULL) return glfwTerminate(), mospt_err_nomem(err, sizeof *w);
    w->title = strdup(title);
    bool ok = w->title != NULL || mospt_err_nomem(err, strlen(title));
    if (!ok || !take_window(w, width, height, err)) {
        glfwTerminate();
        free(w->title);
        free(w);
        return false;
    }
    *out = w;
    return true;
}

/* A window that fills the screen is made as it was before it did. */
bool rgl_window_renew(rgl_window *window, mospt_err *err)
{
    GLFWwindow *before = window->glfw;
    bool fills = glfwGetWindowMonitor(before) != NULL;
    int *place = window->windowed;
    if (!fills) glfwGetWindowPos(before, &place[0], &place[1]);
    if (!fills) glfwGetWindowSize(before, &place[2], &place[3]);
    if (!take_window(window, (uint32_t)place[2], (uint32_t)place[3], err)) return false;
    glfwDestroyWindow(before);
    if (fills) rgl_window_toggle_fullscreen(window);
    else glfwSetWindowPos(window->glfw, place[0], place[1]);
    on_refresh(window->glfw);
    return true;
}

void rgl_window_destroy(rgl_window *window)
{
    if (window == NULL) return;
    glfwDestroyWindow(window->glfw);
    glfwTerminate();
    free(window->title);
    free(window);
}

void rgl_window_wait(rgl_window *window, double seconds)
{
    if (window->count > 0 || seconds == 0) glfwPollEvents();
    else if (seconds < 0) glfwWaitEvents();
    else glfwWaitEventsTimeout(seconds);
}

void rgl_window_wake(void *window)
{
    (void)window;
    glfwPostEmptyEvent();
}

bool rgl_window_next(rgl_window *window, rgl_event *out)
{
    if (window->count == 0) return false;
    *out = window->events[window->first];
    window->first = (window->first + 1) % EVENTS_MAX;
    window->count--;
    return true;
}

bool rgl_window_is_down(const rgl_window *window, int key)
{
    int a = 0, b = 0;
    if (key >= 'A' && key <= 'Z') a = b = GLFW_KEY_A + key - 'A';
    else if (key == RGL_KEY_SHIFT) a = GLFW_KEY_LEFT_SHIFT, b = GLFW_KEY_RIGHT_SHIFT;
    else if (key == RGL_KEY_LEFT) a = b = GLFW_KEY_LEFT;
    else if (key == RGL_KEY_RIGHT) a = b = GLFW_KEY_RIGHT;
    else if (key == RGL_KEY_UP) a = b = GLFW_KEY_UP;
    else if (key == RGL_KEY_DOWN) a = b = GLFW_KEY_DOWN;
    else return false;
    return glfwGetKey(window->glfw, a) == GLFW_PRESS || glfwGetKey(window->glfw, b) == GLFW_PRESS;
}

void rgl_window_size(const rgl_window *window, uint32_t *width, uint32_t *height)
{
    int w, h;
    glfwGetFramebufferSize(window->glfw, &w, &h);
    *width = (uint32_t)w, *height = (uint32_t)h;
}

float rgl_window_scale(const rgl_window *window)
{
    float x = 1, y = 1;
    glfwGetWindowContentScale(window->glfw, &x, &y);
    return y >= 0.5f && y <= 8 ? y : 1;
}

void rgl_window_show(rgl_window *window)
{
    glfwSwapBuffers(window->glfw);
}

void rgl_window_toggle_fullscreen(rgl_window *window)
{
    int *w = window->windowed;
    if (glfwGetWindowMonitor(window->glfw) != NULL) {
        glfwSetWindowMonitor(window->glfw, NULL, w[0], w[1], w[2], w[3], GLFW_DONT_CARE);
        return;
    }
    GLFWmonitor *monitor = glfwGetPrimaryMonitor();
    const GLFWvidmode *mode = monitor != NULL ? glfwGetVideoMode(monitor) : NULL;
    if (mode == NULL) return;
    glfwGetWindowPos(window->glfw, &w[0], &w[1]);
    glfwGetWindowSize(window->glfw, &w[2], &w[3]);
    glfwSetWindowMonitor(window->glfw, monitor, 0, 0, mode->width, mode->height, mode->refreshRate);
}

double rgl_window_seconds(void)
{
    return glfwGetTime();
}
