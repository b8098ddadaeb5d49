# Tests of mospt/, preprocess/ (without the readers) and the program, in C with cmocka.
if(NOT TARGET PkgConfig::CMOCKA)
    pkg_check_modules(CMOCKA REQUIRED IMPORTED_TARGET cmocka)
endif()

add_library(core_tools STATIC core_tools.c ref_mospt.c ref_tree.c core_scans.c)
target_link_libraries(core_tools PUBLIC flags mospt prep PkgConfig::CMOCKA)

foreach(name
        err schema grid cell hierarchy linear payload metadata sink dataset
        arena attributes implied sort spool workers plan solve pass dedupe frame build pose inspect)
    add_executable(test_${name} test_${name}.c)
    target_link_libraries(test_${name} PRIVATE core_tools)
    add_test(NAME ${name} COMMAND test_${name})
    set_tests_properties(${name} PROPERTIES LABELS core TIMEOUT 600)
endforeach()

# The program itself. It is told where it is.
if(TARGET instantpoints)
    foreach(name e2e_cli e2e_many e2e_memory)
        add_executable(${name} ${name}.c)
        target_link_libraries(${name} PRIVATE core_tools PkgConfig::JANSSON)
        add_test(NAME ${name} COMMAND ${name} $<TARGET_FILE:instantpoints>)
        set_tests_properties(${name} PROPERTIES LABELS core TIMEOUT 600)
    endforeach()
endif()
