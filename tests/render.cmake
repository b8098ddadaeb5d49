# Tests of render/. Included by tests/CMakeLists.txt.
if(NOT TARGET PkgConfig::CMOCKA)
    pkg_check_modules(CMOCKA REQUIRED IMPORTED_TARGET cmocka)
endif()

add_library(render_tools STATIC ref_select.c render_tools.c)
target_link_libraries(render_tools PUBLIC rend core_tools)

# Memory that the graphics drivers and fontconfig keep for ever is not ours to free.
set(render_environment
    "LSAN_OPTIONS=suppressions=${CMAKE_CURRENT_SOURCE_DIR}/render_leaks.supp:print_suppressions=0")

foreach(name cache camera clip curve hands loader look motion occlusion orbit pace pages paint panorama path path_file ramp rushes
    scheme select space stage strip sweep touch watch)
    add_executable(test_${name} test_${name}.c)
    target_link_libraries(test_${name} PRIVATE render_tools)
    add_test(NAME ${name} COMMAND test_${name})
    set_tests_properties(${name} PROPERTIES LABELS render TIMEOUT 300)
endforeach()

# The back end on the processor beside OpenGL's.
add_executable(test_cpu keep_libraries.c ref_raster.c test_cpu.c)
target_link_libraries(test_cpu PRIVATE render_tools)
add_test(NAME cpu COMMAND test_cpu)
set_tests_properties(cpu PROPERTIES LABELS render TIMEOUT 300 ENVIRONMENT "${render_environment}")

# With a context: the software renderer will do, and no display is needed.
add_executable(e2e_shot e2e_shot.c keep_libraries.c ref_picture.c)
target_link_libraries(e2e_shot PRIVATE render_tools PkgConfig::PNG)
foreach(renderer gl cpu)
    add_test(NAME e2e_shot_${renderer} COMMAND e2e_shot ${renderer})
    set_tests_properties(e2e_shot_${renderer} PROPERTIES LABELS render TIMEOUT 600 ENVIRONMENT "${render_environment}")
endforeach()

add_executable(e2e_shading e2e_shading.c keep_libraries.c)
target_link_libraries(e2e_shading PRIVATE render_tools)
add_test(NAME e2e_shading COMMAND e2e_shading)
set_tests_properties(e2e_shading PROPERTIES LABELS render TIMEOUT 600 ENVIRONMENT "${render_environment}")

add_executable(e2e_colour e2e_colour.c keep_libraries.c)
target_link_libraries(e2e_colour PRIVATE render_tools PkgConfig::PNG)
add_test(NAME e2e_colour COMMAND e2e_colour)
set_tests_properties(e2e_colour PROPERTIES LABELS render TIMEOUT 600 ENVIRONMENT "${render_environment}")

# Films, decoded again by FFmpeg's libraries.
add_executable(e2e_record e2e_record.c keep_libraries.c ref_film.c)
target_link_libraries(e2e_record PRIVATE render_tools PkgConfig::PNG PkgConfig::LIBAV)
add_test(NAME e2e_record COMMAND e2e_record)
set_tests_properties(e2e_record PROPERTIES LABELS render TIMEOUT 600 ENVIRONMENT "${render_environment}")

# A window, where there is a display to be had without one.
find_program(XVFB_RUN xvfb-run)
if(XVFB_RUN)
    add_executable(e2e_view e2e_view.c keep_libraries.c)
    target_link_libraries(e2e_view PRIVATE render_tools PkgConfig::PNG)
    add_test(NAME e2e_view COMMAND ${XVFB_RUN} -a -s "-screen 0 1024x768x24" $<TARGET_FILE:e2e_view>)
    set_tests_properties(e2e_view PROPERTIES LABELS render TIMEOUT 600 ENVIRONMENT "${render_environment}")
endif()
