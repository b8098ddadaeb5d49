#include "render/gl/program.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef NDEBUG
void rgl_check(const char *call, const char *file, int line)
{
    GLenum error = glGetError();
    if (error == GL_NO_ERROR || error == GL_OUT_OF_MEMORY || error == GL_CONTEXT_LOST) return;
    fprintf(stderr, "%s:%d: GL error 0x%04x in %s\n", file, line, error, call);
    abort();
}
#endif

static bool compile(GLenum kind, const char *defines, const char *source, GLuint *out,
                    mospt_err *err)
{
    static const char version[] = "#version 330 core\n";
    const char *parts[] = {version, defines, source};
    GLuint shader = glCreateShader(kind);
    glShaderSource(shader, 3, parts, NULL);
    glCompileShader(shader);
    GLint ok = 0;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
    if (!ok) {
        char log[400] = "";
        glGetShaderInfoLog(shader, sizeof log, NULL, log);
        glDeleteShader(shader);
        return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                             "the graphics driver refuses a shader: %s", log);
    }
    *out = shader;
    return true;
}

bool rgl_program_create(const char *defines, const char *vertex, const char *fragment, GLuint *out,
                        mospt_err *err)
{
    GLuint vs = 0, fs = 0;
    if (!compile(GL_VERTEX_SHADER, defines, vertex, &vs, err)) return false;
    if (!compile(GL_FRAGMENT_SHADER, defines, fragment, &fs, err)) {
        glDeleteShader(vs);
        return false;
    }
    GLuint program = glCreateProgram();
    glAttachShader(program, vs);
    glAttachShader(program, fs);
    glLinkProgram(program);
    glDeleteShader(vs);
    glDeleteShader(fs);
    GLint ok = 0;
    glGetProgramiv(program, GL_LINK_STATUS, &ok);
    if (!ok) {
        char log[400] = "";
        glGetProgramInfoLog(program, sizeof log, NULL, log);
        glDeleteProgram(program);
        return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                             "the graphics driver refuses a program: %s", log);
    }
    *out = program;
    return true;
}

bool rgl_program_sees_resets(void)
{
    GLint strategy = 0;
    if (!epoxy_has_gl_extension("GL_ARB_robustness")) return false;
    glGetIntegerv(GL_RESET_NOTIFICATION_STRATEGY_ARB, &strategy);
    return strategy == GL_LOSE_CONTEXT_ON_RESET_ARB;
}
