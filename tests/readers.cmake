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
    test_pack
    test_ply
    test_real_scans
    test_scan_memory
    test_text
    test_tone)
    add_executable(${name} ${name}.c)
    target_link_libraries(${name} PRIVATE readers_fixture)
    add_test(NAME ${name} COMMAND ${name})
endforeach()
set_tests_properties(test_real_scans PROPERTIES SKIP_RETURN_CODE 77)

# The fuzzers run here for a second each, as a check that they run; scripts/fuzz runs them for longer.
foreach(format las ply text)
    add_executable(fuzz_${format} fuzz_${format}.c fuzz_main.c)
    target_link_libraries(fuzz_${format} PRIVATE readers_fixture)
    add_test(NAME fuzz_${format} COMMAND fuzz_${format} "${IPTS_SCANS}/${format}" 1)
    set_tests_properties(fuzz_${format} PROPERTIES SKIP_RETURN_CODE 77 LABELS readers TIMEOUT 300)
endforeach()
add_executable(fuzz_split fuzz_split.c fuzz_main.c)
target_link_libraries(fuzz_split PRIVATE readers_fixture)
add_test(NAME fuzz_split COMMAND fuzz_split "${IPTS_SCANS}/text" 1)
set_tests_properties(fuzz_split PROPERTIES SKIP_RETURN_CODE 77 LABELS readers TIMEOUT 300)
