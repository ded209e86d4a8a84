#include <gtest/gtest.h>

#include <cmath>

#include "battery/circuit.h"

namespace joulecast::battery {
namespace {

TEST(CellShapes, FindsChemistriesOfCommonPacks) {
  struct Case {
    double nominal_v;
    const char* chemistry;
  };
  for (const Case& item : {Case{3.7, "lithium-ion"}, Case{14.8, "lithium-ion"}, Case{25.2, "lithium-ion"},
                           Case{36, "lithium-ion"}, Case{12.8, "lithium iron phosphate"},
                           Case{25.6, "lithium iron phosphate"}, Case{51.2, "lithium iron phosphate"},
                           Case{12, "lead-acid"}, Case{24, "lead-acid"}, Case{12.6, "lead-acid"}}) {
    EXPECT_EQ(likeliest_cell(item.nominal_v).chemistry, item.chemistry) << item.nominal_v;
  }
}

TEST(CellShapes, DefaultPackHoldsNominalEnergy) {
  for (const double nominal_v : {0.7, 3.6, 12.6, 24.0, 25.6, 48.0, 51.2, 333.0}) {
    const auto curve = default_open_circuit_voltage(nominal_v);
    EXPECT_NEAR(Curve(curve).mean(), nominal_v, 1e-12 * nominal_v);
    EXPECT_EQ(curve.front().first, 0);
    EXPECT_EQ(curve.back().first, 1);
    for (std::size_t i = 1; i < curve.size(); ++i) {
      EXPECT_GT(curve[i].first, curve[i - 1].first);
      EXPECT_GT(curve[i].second, curve[i - 1].second);
    }
    EXPECT_LE(default_cutoff_voltage_v(nominal_v), curve.front().second * (1 + 1e-12));
    EXPECT_GT(default_cutoff_voltage_v(nominal_v), 0.7 * nominal_v);
  }
}

TEST(Curve, InterpolatesHoldsAndExtends) {
  const Curve curve({{0, 1}, {1, 3}, {3, 4}});
  EXPECT_EQ(curve.held(-1), 1);
  EXPECT_EQ(curve.extended(-1), -1);
  EXPECT_EQ(curve.held(0.5), 2);
  EXPECT_EQ(curve.held(1), 3);
  EXPECT_EQ(curve.held(2), 3.5);
  EXPECT_EQ(curve.held(9), 4);
  EXPECT_EQ(curve.extended(5), 5);
  EXPECT_DOUBLE_EQ(curve.mean(), (2.0 + 7.0) / 3);
  EXPECT_EQ(Curve({{0.5, 7}}).extended(3), 7);
}

}  // namespace
}  // namespace joulecast::battery
