#pragma once

#include <gtest/gtest.h>

#include <filesystem>

// For the body of a test: skips it if there is no shared folder next to the project; fails it if the folder
// lacks the test's files.
#define JOULECAST_NEED_SHARED(present, what)                                                            \
  if (!(present)) {                                                                                     \
    if (std::filesystem::exists(JOULECAST_SHARED)) FAIL() << what << " not found in " JOULECAST_SHARED; \
    GTEST_SKIP() << "no shared folder next to the project";                                             \
  }                                                                                                     \
  static_assert(true)
