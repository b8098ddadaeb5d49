# The comparison with the Point Cloud Library. scripts/setup_pcl FOLDER installs what it needs; say the folder here.
set(IPTS_PCL_ROOT "${CMAKE_SOURCE_DIR}/../pcl" CACHE PATH "Folder that scripts/setup_pcl filled")
enable_language(CXX)
find_path(PCL_HEADERS pcl/io/ply_io.h PATHS "${IPTS_PCL_ROOT}/usr/include" /usr/include PATH_SUFFIXES pcl-1.13
          REQUIRED)
find_path(EIGEN_HEADERS Eigen/Core PATH_SUFFIXES eigen3 REQUIRED)

# our reader behind a C interface, so that the flags for C do not reach the C++ compiler
add_library(pcl_ours STATIC pcl_ours.c)
target_link_libraries(pcl_ours PRIVATE prep mospt)

add_executable(pcl_ply pcl_ply.cpp)
set_target_properties(pcl_ply PROPERTIES CXX_STANDARD 17 CXX_STANDARD_REQUIRED ON)
target_include_directories(pcl_ply PRIVATE ${CMAKE_SOURCE_DIR})
target_include_directories(pcl_ply SYSTEM PRIVATE ${PCL_HEADERS} ${EIGEN_HEADERS})
# the runtime packages have no plain libpcl_io.so, and what they need in turn is found when the program starts
target_link_libraries(pcl_ply PRIVATE pcl_ours -l:libpcl_io.so.1.13 -l:libpcl_io_ply.so.1.13
                      -l:libpcl_common.so.1.13 -Wl,--allow-shlib-undefined)
add_test(NAME pcl_ply COMMAND pcl_ply "${IPTS_SCANS}/ply")
set_tests_properties(pcl_ply PROPERTIES SKIP_RETURN_CODE 77)
