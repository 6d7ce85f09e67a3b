# What every target of the project is compiled with.
#
# No -march=native, no -ffast-math. Contraction is off, so that the same bytes come out on every machine;
# -fno-trapping-math and -fno-math-errno change no value and let guarded divisions and sqrt become vector code.
function(apgm_compile_options target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion
                         -Wnon-virtual-dtor -Woverloaded-virtual -ffp-contract=off -fno-trapping-math -fno-math-errno)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # g++ 12 finds overflows in copies of std::vector and std::string that are not there.
    target_compile_options(${target} PRIVATE -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread -Wno-restrict)
  endif()
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    # Loops that sanitizers keep from becoming vector code.
    target_compile_options(${target} PRIVATE -Wno-pass-failed)
  endif()
  if(APGM_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(APGM_ASSERTS)
    target_compile_options(${target} PRIVATE -UNDEBUG)
  endif()
  if(APGM_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${APGM_SANITIZE} -fno-sanitize-recover=all
                           -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${APGM_SANITIZE})
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      # In the instrumented code of std::regex g++ 12 finds members that are not set.
      target_compile_options(${target} PRIVATE -Wno-maybe-uninitialized)
    endif()
  endif()
endfunction()

# One room of the library: an object library that sees the rooms it names and nothing else.
#   apgm_room(NAME fuse USES core SOURCES a.cpp b.cpp LIBS PkgConfig::ZSTD)
function(apgm_room)
  cmake_parse_arguments(ROOM "" "NAME" "USES;SOURCES;LIBS" ${ARGN})
  add_library(apgm_${ROOM_NAME} OBJECT ${ROOM_SOURCES})
  apgm_compile_options(apgm_${ROOM_NAME})
  target_include_directories(apgm_${ROOM_NAME} PUBLIC ${PROJECT_SOURCE_DIR}/libapgm/include)
  foreach(used ${ROOM_USES})
    target_link_libraries(apgm_${ROOM_NAME} PRIVATE apgm_${used})
  endforeach()
  target_link_libraries(apgm_${ROOM_NAME} PRIVATE ${ROOM_LIBS})
endfunction()

# A test program: apgm_test(core_test SOURCES a_test.cpp b_test.cpp LIBS apgm_core)
# Object libraries do not carry their own needs along: name every room that is linked.
function(apgm_test name)
  cmake_parse_arguments(TEST "" "SHARDS" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${TEST_SOURCES})
  apgm_compile_options(${name})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/tests/support)
  target_link_libraries(${name} PRIVATE ${TEST_LIBS} GTest::gmock GTest::gtest_main)
  if(NOT TEST_SHARDS)
    gtest_discover_tests(${name} NO_PRETTY_VALUES DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 300)
    return()
  endif()
  math(EXPR last "${TEST_SHARDS} - 1")
  foreach(shard RANGE ${last})
    add_test(NAME ${name}.${shard} COMMAND ${name})
    set_tests_properties(${name}.${shard} PROPERTIES TIMEOUT 300
                         ENVIRONMENT "GTEST_TOTAL_SHARDS=${TEST_SHARDS};GTEST_SHARD_INDEX=${shard}")
  endforeach()
endfunction()
