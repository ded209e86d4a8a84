#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

#include "windows/windows.h"

namespace joulecast::windows {
namespace {

struct Blocks {
  std::size_t count;
  std::vector<Window> windows;
  std::map<std::size_t, std::size_t> size;  // windows in each block

  std::size_t of(std::size_t mission) const {
    return std::ranges::find(windows, mission, &Window::mission)->block;
  }
};

// Windows every 0.2 s of missions of these lengths.
Blocks blocks_of(const std::vector<double>& length_s) {
  Blocks b;
  for (std::size_t m = 0; m < length_s.size(); ++m) {
    for (double t = 0.2; t < length_s[m] - 0.1; t += 0.2) {
      Window w;
      w.mission = m;
      w.t_s = t;
      b.windows.push_back(w);
    }
  }
  b.count = assign_blocks(b.windows, length_s);
  for (const Window& w : b.windows) ++b.size[w.block];
  return b;
}

void expect_ascending_without_holes(const Blocks& b) {
  EXPECT_TRUE(std::ranges::is_sorted(b.windows, {}, &Window::block));
  EXPECT_EQ(b.size.size(), b.count);
  EXPECT_EQ(b.size.begin()->first, 0u);
  EXPECT_EQ(b.size.rbegin()->first, b.count - 1);
}

TEST(AssignBlocks, CutsOneMissionIntoTwenty) {
  const Blocks b = blocks_of({1000});
  EXPECT_EQ(b.count, 20u);
  expect_ascending_without_holes(b);
  for (const auto& [block, size] : b.size) EXPECT_NEAR(static_cast<double>(size), 250, 2) << block;
}

TEST(AssignBlocks, SegmentsLastFifteenSeconds) {
  EXPECT_EQ(blocks_of({100}).count, 6u);
  EXPECT_EQ(blocks_of({29}).count, 1u);
  EXPECT_EQ(blocks_of({31}).count, 2u);
}

TEST(AssignBlocks, CutsFewMissionsSeparately) {
  const Blocks b = blocks_of({100, 47, 160});
  EXPECT_EQ(b.count, 6u + 3u + 10u);
  expect_ascending_without_holes(b);
  std::map<std::size_t, std::size_t> mission;
  for (const Window& w : b.windows)
    EXPECT_EQ(mission.try_emplace(w.block, w.mission).first->second, w.mission);
}

TEST(AssignBlocks, KeepsEightMissionsWhole) {
  const Blocks b = blocks_of({100, 30, 60, 45, 80, 200, 50, 70});
  EXPECT_EQ(b.count, 8u);
  expect_ascending_without_holes(b);
  for (const Window& w : b.windows) EXPECT_EQ(w.block, w.mission);
}

TEST(AssignBlocks, ManyMissionsShareBlocks) {
  const Blocks b = blocks_of(std::vector<double>(100, 30));
  EXPECT_EQ(b.count, 20u);
  expect_ascending_without_holes(b);
  for (const auto& [block, size] : b.size) EXPECT_NEAR(static_cast<double>(size), 5 * 149, 10) << block;
  for (std::size_t m = 0; m < 100; ++m) {
    for (const Window& w : b.windows) {
      if (w.mission == m) {
        EXPECT_EQ(w.block, b.of(m));
      }
    }
  }
}

TEST(AssignBlocks, ShortMissionsJoinNextOnes) {
  const Blocks b = blocks_of({6, 6, 100, 6});
  expect_ascending_without_holes(b);
  EXPECT_EQ(b.of(0), b.of(1));
  EXPECT_EQ(b.of(2), 1u);
  EXPECT_EQ(b.count, 1 + 6 + 1u);
}

TEST(AssignBlocks, AcceptsTimesAtEnds) {
  std::vector<Window> windows(3);
  windows[0].t_s = -0.5;
  windows[1].t_s = 60;
  windows[2].t_s = 61;
  EXPECT_EQ(assign_blocks(windows, std::vector<double>{60}), 4u);
  EXPECT_EQ(windows[0].block, 0u);
  EXPECT_EQ(windows[1].block, 3u);
  EXPECT_EQ(windows[2].block, 3u);
}

}  // namespace
}  // namespace joulecast::windows
