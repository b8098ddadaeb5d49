# The PTX and PCD readers. The fuzzers run here for a second each, as a check that they run.

foreach(format ptx pcd)
    add_executable(test_${format} test_${format}.c scan_points.c)
    target_link_libraries(test_${format} PRIVATE prep mospt PkgConfig::CMOCKA PkgConfig::ZLIB)
    add_test(NAME test_${format} COMMAND test_${format})

    add_executable(fuzz_${format} fuzz_${format}.c fuzz_main.c scan_points.c)
    target_link_libraries(fuzz_${format} PRIVATE prep mospt)
    add_test(NAME fuzz_${format} COMMAND fuzz_${format} "${IPTS_SCANS}/${format}" 1)
    set_tests_properties(fuzz_${format} PROPERTIES SKIP_RETURN_CODE 77)
    set_tests_properties(test_${format} fuzz_${format} PROPERTIES LABELS readers TIMEOUT 300)
endforeach()
