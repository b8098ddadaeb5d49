# Tests of the scan readers. Included by tests/CMakeLists.txt.
add_library(readers_fixture STATIC
    scan_points.c
    write_las.c)
target_link_libraries(readers_fixture PUBLIC prep mospt PkgConfig::CMOCKA PkgConfig::ZLIB)
target_compile_definitions(readers_fixture PUBLIC IPTS_SOURCE_DIR="${CMAKE_SOURCE_DIR}")

foreach(name
    test_folder
    test_las
    test_number
    test_ply
    test_real_scans
    test_text)
    add_executable(${name} ${name}.c)
    target_link_libraries(${name} PRIVATE readers_fixture)
    add_test(NAME ${name} COMMAND ${name})
endforeach()
set_tests_properties(test_real_scans PROPERTIES SKIP_RETURN_CODE 77)
