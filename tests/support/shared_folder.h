#pragma once

#include <gtest/gtest.h>

#include <filesystem>

// For the body of a test: skips it where there is no shared folder beside the project; fails it where there
// is one that lacks what the test reads.
#define JOULECAST_NEED_SHARED(present, what)                                                            \
  if (!(present)) {                                                                                     \
    if (std::filesystem::exists(JOULECAST_SHARED)) FAIL() << what << " not found in " JOULECAST_SHARED; \
    GTEST_SKIP() << "no shared folder beside the project";                                              \
  }                                                                                                     \
  static_assert(true)
