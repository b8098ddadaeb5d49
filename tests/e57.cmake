# Tests of the E57 reader. Included by tests/CMakeLists.txt, behind readers.cmake.
add_library(e57_fixture STATIC e57_tools.c write_e57.c)
target_link_libraries(e57_fixture PUBLIC readers_fixture)
target_compile_definitions(e57_fixture PUBLIC IPTS_SCANS="${IPTS_SCANS}")

foreach(name test_e57 test_e57_damage)
    add_executable(${name} ${name}.c)
    target_link_libraries(${name} PRIVATE e57_fixture)
    add_test(NAME ${name} COMMAND ${name})
endforeach()

add_executable(fuzz_e57 fuzz_e57.c fuzz_main.c)
target_link_libraries(fuzz_e57 PRIVATE e57_fixture)

# Small files of every format to start fuzzing from.
add_executable(fuzz_seeds fuzz_seeds.c write_laz.c write_laz_coder.c)
target_link_libraries(fuzz_seeds PRIVATE e57_fixture)
add_test(NAME fuzz_seeds COMMAND fuzz_seeds "${CMAKE_BINARY_DIR}/seeds")
set_tests_properties(fuzz_seeds PROPERTIES FIXTURES_SETUP fuzz_seeds)
add_test(NAME fuzz_e57 COMMAND fuzz_e57 "${CMAKE_BINARY_DIR}/seeds/e57" 1)
set_tests_properties(fuzz_e57 PROPERTIES FIXTURES_REQUIRED fuzz_seeds)
set_tests_properties(test_e57 test_e57_damage fuzz_e57 PROPERTIES TIMEOUT 300)
