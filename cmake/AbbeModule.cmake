# A module is a folder with public headers in include/abbe/NAME and sources in src, built as one
# static library abbe_NAME. The library exposes nothing but its own include folder, so a dependency
# that the architecture forbids does not compile.

add_library(abbe_warnings INTERFACE)
add_library(abbe::warnings ALIAS abbe_warnings)
target_compile_options(abbe_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wnon-virtual-dtor -Wold-style-cast -Werror
  -Wno-sign-conversion              # indices: Eigen counts signed, std unsigned
  -Wno-missing-field-initializers   # designated initialisers leave the other members at their defaults on purpose
  $<$<CXX_COMPILER_ID:Clang>:-Wthread-safety>
  # GCC 12 at -O3 gives false warnings of overlaps and bounds in inlined std::string (GCC bug 105651)
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<CONFIG:Release>>:-Wno-restrict$<SEMICOLON>-Wno-array-bounds$<SEMICOLON>-Wno-stringop-overflow>)

# Options with which the fuzzer and ThreadSanitizer observe a program. abbe_compile_mathematics()
# removes them from targets in which they find nothing.
set(abbe_observing_options "")
set(abbe_sanitizing_options "")
if(ABBE_SANITIZE MATCHES "thread")
  list(APPEND abbe_observing_options -fsanitize=thread -fno-omit-frame-pointer -O1 -g1 -UNDEBUG)
  add_link_options(-fsanitize=thread)
elseif(ABBE_SANITIZE)
  set(abbe_sanitizing_options -fsanitize=${ABBE_SANITIZE} -fno-omit-frame-pointer -O2 -g1 -UNDEBUG)
  add_link_options(-fsanitize=${ABBE_SANITIZE})
  if(ABBE_SANITIZE MATCHES "undefined")
    # The check object-size takes a fifth of the optimizer's time, and ASan finds the same accesses
    # outside an object.
    list(APPEND abbe_sanitizing_options -fno-sanitize-recover=undefined -fno-sanitize=object-size)
  endif()
endif()
add_compile_options(${abbe_observing_options} ${abbe_sanitizing_options})
# The fuzzer measures coverage in modules, not in programs and tests.
if(ABBE_FUZZ)
  set(abbe_coverage_options -fsanitize=fuzzer-no-link)
  list(APPEND abbe_observing_options ${abbe_coverage_options})
endif()

# Identification gives the same bits on every processor: abbe_same_bits() compiles Eigen without
# vector instructions, so that it sums in one order, independent of the width of the registers, the
# place of the data in memory and the size of the caches; and multiplication and addition are not
# fused.
add_compile_options(-ffp-contract=off)
# The preset "campaign" sets ABBE_SAME_BITS to OFF. The preset also turns warnings off, because GCC
# 12 gives false warnings for its own AVX-512 headers.
option(ABBE_SAME_BITS "Eigen without vectors: the same bits on every processor" ON)
function(abbe_same_bits target)
  if(NOT ABBE_SAME_BITS)
    return()
  endif()
  target_compile_definitions(${target} PUBLIC EIGEN_DONT_VECTORIZE EIGEN_NO_CPUID EIGEN_DEFAULT_L1_CACHE_SIZE=32768
                             EIGEN_DEFAULT_L2_CACHE_SIZE=262144 EIGEN_DEFAULT_L3_CACHE_SIZE=2097152)
endfunction()

# For targets that compute little: in sanitizer builds optimising them takes longer than it saves at
# run time.
function(abbe_compile_fast target)
  if(ABBE_SANITIZE)
    target_compile_options(${target} PRIVATE -O0)
  endif()
endfunction()

# For targets that every one of 100,000 rows, samples or messages passes through: in sanitizer builds
# -O2 saves the tests more time than it costs (-O1 costs as much, but inlines no small functions).
function(abbe_compile_rows target)
  if(ABBE_SANITIZE)
    target_compile_options(${target} PRIVATE -O2)
  endif()
endfunction()

# For targets that read a configuration, write a report or run a command. At -O3 the templates of
# CLI11, fmt, toml++ and JSON take most of the time of a release build; -O1 is sufficient for such
# code.
function(abbe_compile_brief target)
  if(NOT abbe_sanitizing_options)
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
  endif()
endfunction()

# For targets that use Eigen.
# - UBSan's checks for null pointers and alignment take half of their compile time, and are not
#   needed: ASan reports a null access, and an unaligned SSE access ends the program.
# - UBSan's check of pointer arithmetic takes four fifths of the time of a product of matrices. It
#   finds addresses that wrap around; ASan reports an access through such an address.
# - These targets start no threads and decode no input, so the options of ThreadSanitizer and
#   libFuzzer are removed. The targets are then compiled as in the release or ASan build, and ccache
#   has the result. With ThreadSanitizer an identification would take minutes. Such a target must not
#   use std::shared_ptr: the linker may keep its copy of the reference counter for the whole program,
#   and ThreadSanitizer, which does not see this copy, reports races where there are none.
# - Products and decompositions take five times as long with AddressSanitizer. A target of `calib`
#   is compiled as in the release build, so that ccache has it, unless ABBE_SANITIZE_CALIB is set:
#   `scripts/nightly calib` runs its tests with both sanitizers and the assertions of Eigen and of
#   the C++ library. calib comes first in a program, so that the copies of inline functions which it
#   contains are those of the whole program: they are not checked in the other modules, either.
option(ABBE_SANITIZE_CALIB "Compile calib and its tests with the sanitizers, too" OFF)
function(abbe_remove_options target)
  get_target_property(options ${target} COMPILE_OPTIONS)
  list(REMOVE_ITEM options ${ARGN})
  set_property(TARGET ${target} PROPERTY COMPILE_OPTIONS ${options})
endfunction()

function(abbe_compile_mathematics target)
  if(ABBE_SANITIZE MATCHES "undefined")
    target_compile_options(${target} PRIVATE -fno-sanitize=null,alignment,pointer-overflow)
  endif()
  abbe_remove_options(${target} ${abbe_observing_options})
endfunction()

function(abbe_compile_calib target)
  if(ABBE_SANITIZE_CALIB)
    abbe_compile_mathematics(${target})
    target_compile_definitions(${target} PRIVATE _GLIBCXX_ASSERTIONS)
  else()
    abbe_remove_options(${target} ${abbe_observing_options} ${abbe_sanitizing_options})
  endif()
endfunction()

# GCC warns about types in the unnamed namespaces of source files that another source file includes
# (unity builds); this turns the warning off.
function(abbe_allow_local_types target)
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endfunction()

# Most of the compile time of a source file is spent on the templates of its headers. With
# ABBE_UNITY_BUILD up to 25 files of a target are compiled as one, so that a header is compiled once
# for all of them. A name that is local to a file must therefore be unique in its target, also in
# tests.
option(ABBE_UNITY_BUILD "Compile several source files of a module as one: faster when everything is built" OFF)
function(abbe_unity_build target)
  if(ABBE_UNITY_BUILD)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 25)
    abbe_allow_local_types(${target})
  endif()
endfunction()

# Compiles the source files whose path matches `pattern` as one in a unity build. The groups of a
# target do not depend on the number of its files: a new file changes its own group only.
function(abbe_unity_group target group pattern)
  get_target_property(sources ${target} SOURCES)
  list(FILTER sources INCLUDE REGEX "${pattern}")
  set_source_files_properties(${sources} PROPERTIES UNITY_GROUP ${group})
  set_target_properties(${target} PROPERTIES UNITY_BUILD_MODE GROUP)
endfunction()

function(abbe_module name)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/src/*.cpp)
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/include/*.hpp)
  add_library(abbe_${name} STATIC ${sources})
  add_library(abbe::${name} ALIAS abbe_${name})
  set_target_properties(abbe_${name} PROPERTIES EXPORT_NAME ${name} VERIFY_INTERFACE_HEADER_SETS ON
                        POSITION_INDEPENDENT_CODE ON)
  target_sources(abbe_${name} PUBLIC FILE_SET HEADERS BASE_DIRS ${CMAKE_CURRENT_SOURCE_DIR}/include
                                     FILES ${headers})
  target_include_directories(abbe_${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/src)
  target_compile_features(abbe_${name} PUBLIC cxx_std_20)
  target_compile_options(abbe_${name} PRIVATE ${abbe_coverage_options})
  target_link_libraries(abbe_${name} PRIVATE $<BUILD_INTERFACE:abbe::warnings>)
endfunction()
