#include "ingest/fleet_view.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace joulecast::ingest {
namespace {

std::shared_ptr<const RobotSnapshot> snapshot(const std::string& robot_id, std::uint64_t samples) {
  RobotSnapshot made;
  made.robot_id = robot_id;
  made.samples = samples;
  return std::make_shared<const RobotSnapshot>(std::move(made));
}

TEST(FleetView, KeepsTheLatestByRobot) {
  FleetView fleet;
  EXPECT_EQ(fleet.find("a"), nullptr);
  fleet.publish(snapshot("b", 1));
  fleet.publish(snapshot("a", 1));
  fleet.publish(snapshot("a", 2));
  EXPECT_EQ(fleet.find("a")->samples, 2u);
  ASSERT_EQ(fleet.all().size(), 2u);
  EXPECT_EQ(fleet.all().front()->robot_id, "a");
  fleet.remove("a");
  fleet.remove("absent");
  EXPECT_EQ(fleet.find("a"), nullptr);
}

// For the thread sanitizer.
TEST(FleetView, IsReadDuringPublishing) {
  FleetView fleet;
  fleet.publish(snapshot("a", 0));
  std::atomic<bool> done = false;
  std::atomic<int> backwards = 0;
  std::vector<std::thread> readers;
  for (int k = 0; k < 3; ++k)
    readers.emplace_back([&] {
      std::uint64_t last = 0;
      while (!done) {
        const auto seen = fleet.find("a");
        if (seen == nullptr || seen->samples < last) ++backwards;
        if (seen != nullptr) last = seen->samples;
        for (const auto& each : fleet.all()) backwards += each == nullptr;
      }
    });
  for (std::uint64_t n = 1; n <= 20'000; ++n) {
    fleet.publish(snapshot("a", n));
    if (n % 100 == 0) fleet.publish(snapshot("b", n)), fleet.remove("b");
  }
  done = true;
  for (auto& reader : readers) reader.join();
  EXPECT_EQ(backwards, 0);
  EXPECT_EQ(fleet.find("a")->samples, 20'000u);
}

}  // namespace
}  // namespace joulecast::ingest
