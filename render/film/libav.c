#include "render/film/libav.h"

#include <dlfcn.h>
#include <pthread.h>
#include <string.h>

#define TEXT_OF(number) #number
#define NUMBER(number) TEXT_OF(number)
#ifdef __APPLE__
#define FILE_OF(name, version) "lib" name "." NUMBER(version) ".dylib"
#else
#define FILE_OF(name, version) "lib" name ".so." NUMBER(version)
#endif

rfilm_libav libav;
static mospt_err failure;

static bool find(void *library, const char *file, const char *name, void *function)
{
    void *found = library != NULL ? dlsym(library, name) : NULL;
    if (found == NULL)
        return mospt_err_set(&failure, MOSPT_EINVAL, mospt_at_file(file),
                             "%s; films need FFmpeg's libraries",
                             library == NULL ? "is not installed" : "is not what it should be");
    memcpy(function, &found, sizeof found);
    return true;
}

static void load(void)
{
    const char *file = NULL;
    void *library = NULL;
    bool ok = true;
#define FIND(name) ok = ok && find(library, file, #name, &libav.name);
#define LOAD(library_name, version)                                                                \
    library = dlopen(file = FILE_OF(library_name, version), RTLD_LAZY)
    LOAD("avutil", LIBAVUTIL_VERSION_MAJOR);
    RFILM_AVUTIL(FIND)
    LOAD("avcodec", LIBAVCODEC_VERSION_MAJOR);
    RFILM_AVCODEC(FIND)
    LOAD("avformat", LIBAVFORMAT_VERSION_MAJOR);
    RFILM_AVFORMAT(FIND)
    LOAD("swscale", LIBSWSCALE_VERSION_MAJOR);
    RFILM_SWSCALE(FIND)
#undef FIND
#undef LOAD
}

bool rfilm_libav_load(mospt_err *err)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, load);
    if (failure.code != MOSPT_OK && err != NULL) *err = failure;
    return failure.code == MOSPT_OK;
}
