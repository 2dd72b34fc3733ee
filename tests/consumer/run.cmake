# cmake -D build_dir= -D config= -D generator= -D compiler= -D work_dir= -P run.cmake
set(prefix ${work_dir}/prefix)
file(REMOVE_RECURSE ${work_dir})  # nothing left from the last time may help
file(MAKE_DIRECTORY ${work_dir})
foreach(step IN ITEMS
    "${CMAKE_COMMAND};--install;${build_dir};--prefix;${prefix};--config;${config}"
    "${CMAKE_COMMAND};-S;${CMAKE_CURRENT_LIST_DIR};-B;${work_dir}/build;-G;${generator};-DCMAKE_PREFIX_PATH=${prefix};-DCMAKE_CXX_COMPILER=${compiler};-DCMAKE_BUILD_TYPE=${config}"
    "${CMAKE_COMMAND};--build;${work_dir}/build;--config;${config}"
    "${work_dir}/build/consumer"
    "${prefix}/bin/isotrack;--version")
  execute_process(COMMAND ${step} COMMAND_ERROR_IS_FATAL ANY WORKING_DIRECTORY ${work_dir})
endforeach()
