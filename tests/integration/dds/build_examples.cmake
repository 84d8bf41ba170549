# cmake -DBUILD_DIR= -DWORK_DIR= -DC_COMPILER= -DCXX_COMPILER= -DFLAGS= -DLAUNCHER= -P: installs the
# component subscriber below WORK_DIR/prefix, and builds its examples in WORK_DIR/build with nothing
# but the installed files. The compiler's cache knows them, because the folders are always the same.
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()
file(REMOVE_RECURSE ${WORK_DIR})
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --component subscriber --prefix ${WORK_DIR}/prefix)
foreach(language C CXX)
  list(APPEND options -DCMAKE_${language}_COMPILER=${${language}_COMPILER} "-DCMAKE_${language}_FLAGS=${FLAGS}"
                      -DCMAKE_${language}_COMPILER_LAUNCHER=${LAUNCHER})
endforeach()
run(${CMAKE_COMMAND} -G Ninja -S ${WORK_DIR}/prefix/share/doc/libabbe-subscriber-dev/examples -B ${WORK_DIR}/build
    -DCMAKE_PREFIX_PATH=${WORK_DIR}/prefix ${options})
run(${CMAKE_COMMAND} --build ${WORK_DIR}/build)
