/* Linked into tests that load graphics drivers: nothing is ever unloaded, so that a leak check can
 * still tell by its name which library memory belongs to (render_leaks.supp). */
#include <dlfcn.h>

int dlclose(void *handle)
{
    (void)handle;
    return 0;
}
