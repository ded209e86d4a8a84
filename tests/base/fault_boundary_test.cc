#include "base/fault_boundary.h"

#include <gtest/gtest.h>

#include <new>
#include <stdexcept>
#include <string>

namespace joulecast {
namespace {

TEST(FaultBoundary, ReportsExceptionsAndContinues) {
  std::string told;
  observe_faults([&](std::string_view part, std::string_view why) {
    told += std::string(part) + ": " + std::string(why) + "\n";
    if (why == "twice") throw std::runtime_error("the observer's own");
  });
  EXPECT_TRUE(survive("a", [] {}));
  EXPECT_FALSE(survive("b", [] { throw std::runtime_error("broken"); }));
  EXPECT_FALSE(survive("c", [] { throw 1; }));
  EXPECT_FALSE(survive("d", [] { throw std::bad_alloc(); }));
  EXPECT_FALSE(survive("e", [] { throw std::runtime_error("twice"); }));
  observe_faults({});
  EXPECT_FALSE(survive("f", [] { throw 1; }));
  EXPECT_EQ(told, "b: broken\nc: an exception of unknown type\nd: std::bad_alloc\ne: twice\n");
}

}  // namespace
}  // namespace joulecast
