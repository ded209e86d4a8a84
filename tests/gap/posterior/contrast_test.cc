#include "gap/groups/contrast.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/gap/posterior/made_robot.h"

namespace joulecast::gap {
namespace {

using posterior::made::Drives;

Contrasted contrasted(std::vector<std::size_t> group_of_mission) {
  Drives drives(31);
  auto data = posterior::make_data(drives.recordings().missions, drives.robot);
  EXPECT_TRUE(data);
  data->group = std::move(group_of_mission);
  return contrast(*posterior::walk(std::move(*data)));
}

// Of strengths between a and b two differ by b - a at most; a load may be anything that the catalogue allows.
TEST(Contrast, DiffersWithinTheRangeOfStrengths) {
  for (const auto& groups : {std::vector<std::size_t>{0, 0, 1, 1}, std::vector<std::size_t>{0, 1, 2, 2}}) {
    const Contrasted c = contrasted(groups);
    std::size_t seen = 0;
    for (const Hypothesis& h : c.fit->catalogue.hypotheses) {
      EXPECT_EQ(h.least, -h.most) << h.id();
      if (h.id() != "gear_efficiency" && h.id() != "accessory_load" && h.id() != "slope") continue;
      const auto& loss = h.effect.effect->info().parameters[h.parameter];
      const double range = h.id() == "slope" ? 2 * loss.maximum : loss.maximum - loss.minimum;  // any heading
      EXPECT_DOUBLE_EQ(h.most, range) << h.id();
      ++seen;
    }
    EXPECT_GE(seen, 2 * c.contrasts.count());
  }
}

// The shared strength has a deviation of 30 % of power, at most its range.
TEST(Contrast, SharedStrengthIsPossible) {
  const Contrasted c = contrasted({0, 1, 0, 1});
  const posterior::Equations& e = c.fit->equations;
  const std::size_t own = e.effects / 2;
  bool narrow = false, wide = false;
  for (std::size_t k = 0; k < own; ++k) {
    const double range = c.fit->catalogue.hypotheses[c.fit->catalogue.columns[k].hypothesis].most;
    const double of_power = 0.3 * e.columns[own + k].unit;
    EXPECT_NEAR(e.columns[own + k].tolerance, std::min(of_power, range), 1e-9 * range);
    narrow = narrow || range < of_power;
    wide = wide || of_power < range;
  }
  EXPECT_TRUE(narrow && wide);
}

}  // namespace
}  // namespace joulecast::gap
