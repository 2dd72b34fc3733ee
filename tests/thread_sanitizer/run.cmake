# cmake -D generator= -D compiler= -D launcher= -D work_dir= -P run.cmake
# The build stays, so that the next run compiles only what has changed.
foreach(step IN ITEMS
    "${CMAKE_COMMAND};-S;${CMAKE_CURRENT_LIST_DIR};-B;${work_dir};-G;${generator};-DCMAKE_CXX_COMPILER=${compiler};-DCMAKE_CXX_COMPILER_LAUNCHER=${launcher};-DCMAKE_BUILD_TYPE=None"
    "${CMAKE_COMMAND};--build;${work_dir};--parallel"
    "${CMAKE_COMMAND};-E;env;TSAN_OPTIONS=halt_on_error=1;${work_dir}/races")
  execute_process(COMMAND ${step} COMMAND_ERROR_IS_FATAL ANY)
endforeach()
