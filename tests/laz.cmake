# Tests of the LAZ decoder. Included by tests/CMakeLists.txt, behind readers.cmake.
add_executable(test_laz test_laz.c write_laz.c write_laz_coder.c)
target_link_libraries(test_laz PRIVATE readers_fixture)
add_test(NAME test_laz COMMAND test_laz)

add_executable(fuzz_laz fuzz_laz.c fuzz_main.c)
target_link_libraries(fuzz_laz PRIVATE readers_fixture)
add_test(NAME fuzz_laz COMMAND fuzz_laz "${IPTS_SCANS}/laz" 1)
set_tests_properties(fuzz_laz PROPERTIES SKIP_RETURN_CODE 77)
set_tests_properties(test_laz fuzz_laz PROPERTIES LABELS readers TIMEOUT 300)
