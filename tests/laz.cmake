# Tests of the LAZ decoder. Included by tests/CMakeLists.txt, behind readers.cmake.
add_library(laz_fixture STATIC laz_twins.c write_laz.c write_laz_coder.c)
target_link_libraries(laz_fixture PUBLIC readers_fixture)

add_executable(test_laz test_laz.c)
target_link_libraries(test_laz PRIVATE laz_fixture)
add_test(NAME test_laz COMMAND test_laz)

add_executable(test_twins test_twins.c)
target_link_libraries(test_twins PRIVATE laz_fixture core_tools)
add_test(NAME test_twins COMMAND test_twins)

add_executable(fuzz_laz fuzz_laz.c fuzz_main.c)
target_link_libraries(fuzz_laz PRIVATE readers_fixture)
add_test(NAME fuzz_laz COMMAND fuzz_laz "${IPTS_SCANS}/laz" 1)
set_tests_properties(fuzz_laz PROPERTIES SKIP_RETURN_CODE 77)
set_tests_properties(test_laz test_twins fuzz_laz PROPERTIES LABELS readers TIMEOUT 300)
