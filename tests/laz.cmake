# The LAZ decoder. Needs readers.cmake. The fuzzer is a program of its own where there is no libFuzzer: fuzz_laz SECONDS [SEED
# FILE...]
add_executable(test_laz test_laz.c write_laz.c)
target_link_libraries(test_laz PRIVATE readers_fixture)
add_test(NAME test_laz COMMAND test_laz)

add_executable(fuzz_laz fuzz_laz.c write_laz.c)
target_link_libraries(fuzz_laz PRIVATE readers_fixture)
add_test(NAME fuzz_laz COMMAND fuzz_laz 3)
set_tests_properties(test_laz fuzz_laz PROPERTIES LABELS readers TIMEOUT 300)
