#include "foreign_coverage.h"

#include <gtest/gtest.h>

#include "asking.h"
#include "base/median.h"

namespace joulecast::forecast {
namespace {

// One kind of robots that do not follow their plans, of a plant that shares no equation with the product. The
// forecasts of one kind depend on each other, so that the interval's coverage of 90 % is counted as twenty
// independent forecasts; forecast_figures counts many kinds.
TEST(ForeignFleet, IntervalsContainUnstatedScatter) {
  const ForeignCoverage coverage = foreign_coverage(2001, 2);
  const double least = static_cast<double>(expected_hits(20, 0.95)[0]) / 20;
  for (const char* name : {"ways, after 30", "cruises, halts, after 30", "all, driven so, after 30",
                           "all, driven otherwise, after 30", "first payload, ways", "first payload, all",
                           "by siblings, ways", "by siblings, all"}) {
    const RowCoverage& row = coverage.rows.at(name);
    const auto share = [&](std::size_t inside) {
      return static_cast<double>(inside) / static_cast<double>(row.count());
    };
    EXPECT_GE(row.count(), 70u) << name;
    EXPECT_GE(share(row.energy_inside), least) << name;
    EXPECT_GE(share(row.duration_inside), least) << name;
    EXPECT_LT(std::fabs(upper_median(row.energy_error)), 0.05) << name;
    EXPECT_LT(std::fabs(upper_median(row.duration_error)), 0.05) << name;
  }
}

}  // namespace
}  // namespace joulecast::forecast
