#include "server/diagnosis/confined.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace joulecast::server {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

const Report never_ends = [](double) { return true; };

TEST(Confined, ReturnsResultOfWork) {
  const std::string large(3 << 20, 'x');  // exceeds the buffer of a pipe
  const auto answer = run_confined(
      {}, [&](const Report&) -> Result<std::string> { return large + std::to_string(getpid()); }, never_ends);
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer->substr(0, large.size()), large);
  EXPECT_NE(answer->substr(large.size()), std::to_string(getpid()));
}

TEST(Confined, ReturnsErrorOfWork) {
  const auto answer = run_confined(
      {},
      [](const Report&) -> Result<std::string> { return fail(Fault::conflict, "robot", "drove nowhere"); },
      never_ends);
  ASSERT_FALSE(answer);
  EXPECT_NE(answer.error().message.find("drove nowhere"), std::string::npos);
}

TEST(Confined, ReturnsExceptionsAsErrors) {
  const auto answer = run_confined(
      {}, [](const Report&) -> Result<std::string> { throw std::runtime_error("a bad day"); }, never_ends);
  ASSERT_FALSE(answer);
  EXPECT_NE(answer.error().message.find("a bad day"), std::string::npos);
}

TEST(Confined, ReturnsErrorOnCrash) {
  const auto answer = run_confined(
      {},
      [](const Report&) -> Result<std::string> {
        signal(SIGSEGV, SIG_DFL);  // sanitizers install a handler
        raise(SIGSEGV);
        return std::string();
      },
      never_ends);
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().fault, Fault::internal);
  EXPECT_NE(answer.error().message.find("signal 11"), std::string::npos) << answer.error().message;
}

TEST(Confined, StopsWorkAtDeadline) {
  const auto began = Clock::now();
  const auto answer = run_confined(
      {.deadline = milliseconds(300)},
      [](const Report&) -> Result<std::string> {
        for (;;) pause();
      },
      never_ends);
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().fault, Fault::too_large);
  EXPECT_LT(Clock::now() - began, milliseconds(5000));
}

TEST(Confined, StopsCancelledWork) {
  std::atomic<int> asked = 0;
  const auto answer = run_confined(
      {},
      [](const Report&) -> Result<std::string> {
        for (;;) pause();
      },
      [&](double) { return ++asked < 3; });
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().fault, Fault::stopped);
}

TEST(Confined, ReportsProgressOfWork) {
  std::vector<double> seen;
  const auto answer = run_confined(
      {},
      [](const Report& report) -> Result<std::string> {
        report(0.5);
        std::this_thread::sleep_for(milliseconds(400));
        return std::string("done");
      },
      [&](double fraction) {
        seen.push_back(fraction);
        return true;
      });
  ASSERT_TRUE(answer);
  EXPECT_EQ(seen.front(), 0);
  EXPECT_EQ(seen.back(), 0.5);
}

TEST(Confined, AllowsThreadsInWork) {
  const auto answer = run_confined(
      {},
      [](const Report&) -> Result<std::string> {
        std::atomic<int> sum = 0;
        std::vector<std::thread> threads;
        for (int k = 0; k < 4; ++k) threads.emplace_back([&sum] { ++sum; });
        for (std::thread& thread : threads) thread.join();
        return std::to_string(sum.load());
      },
      never_ends);
  ASSERT_TRUE(answer);
  EXPECT_EQ(*answer, "4");
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(Confined, StopsWorkAtMemoryLimit) {
  const std::vector<char> held(std::size_t{64} << 20, 'x');  // memory of the process is excluded
  const auto answer = run_confined(
      {.max_memory_bytes = std::uint64_t{128} << 20},
      [](const Report&) -> Result<std::string> {
        std::vector<std::string> all;
        for (;;) all.emplace_back(std::size_t{1} << 20, 'x');
      },
      never_ends);
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().fault, Fault::too_large);
  EXPECT_NE(answer.error().message.find("max_memory_bytes"), std::string::npos);
}
#endif

}  // namespace
}  // namespace joulecast::server
