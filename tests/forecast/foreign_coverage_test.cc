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
  const auto share = [](const RowCoverage& row, std::size_t inside) {
    return static_cast<double>(inside) / static_cast<double>(row.count());
  };
  // Few missions leave the median open, and the interval contains that.
  for (const char* name : {"ways, after  1", "cruises, halts, after  1", "all, driven so, after  1",
                           "all, driven otherwise, after  1", "ways, after  5", "cruises, halts, after  5",
                           "all, driven so, after  5", "all, driven otherwise, after  5"}) {
    const RowCoverage& row = coverage.rows.at(name);
    EXPECT_GE(share(row, row.energy_inside), least) << name;
    EXPECT_GE(share(row, row.duration_inside), least) << name;
  }
  // Probabilities stated of robots from five missions on; forecasts of one kind depend on each other.
  for (const StatedChances& chances : coverage.known) {
    if (chances.count < 400) continue;
    const auto n = static_cast<double>(chances.count);
    EXPECT_NEAR(static_cast<double>(chances.held) / n, chances.sum / n, 0.1);
  }
  for (const char* name : {"ways, after 30", "cruises, halts, after 30", "all, driven so, after 30",
                           "all, driven otherwise, after 30", "first payload, ways", "first payload, all",
                           "by siblings, ways", "by siblings, all"}) {
    const RowCoverage& row = coverage.rows.at(name);
    EXPECT_GE(row.count(), 70u) << name;
    EXPECT_GE(share(row, row.energy_inside), least) << name;
    EXPECT_GE(share(row, row.duration_inside), least) << name;
    EXPECT_LT(std::fabs(upper_median(row.energy_error)), 0.05) << name;
    EXPECT_LT(std::fabs(upper_median(row.duration_error)), 0.05) << name;
  }
}

}  // namespace
}  // namespace joulecast::forecast
