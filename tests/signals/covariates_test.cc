#include "signals/covariates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace joulecast::signals {
namespace {

using ::testing::ElementsAre;
using ::testing::IsNan;

TEST(Covariates, SortsSeriesByTime) {
  const std::vector<CovariateChange> changes{
      {10, "b", 1}, {30, "a", 3}, {20, "a", 2}, {20, "a", 4}, {40, "b", unmeasured}};
  const auto series = series_of(changes);
  ASSERT_EQ(series.size(), 2u);
  EXPECT_EQ(series[0].name, "b");
  EXPECT_THAT(series[0].value, ElementsAre(1, IsNan()));
  EXPECT_THAT(series[1].utime_us, ElementsAre(20, 30));
  EXPECT_THAT(series[1].value, ElementsAre(4, 3));  // of two at the same time, the later in the list
  const auto again = changes_of(series);
  ASSERT_EQ(again.size(), 4u);
  EXPECT_EQ(again[1].name, "a");
  EXPECT_EQ(again[1].utime_us, 20);

  CovariateReader reader(find_series(series, "a"));
  EXPECT_THAT(reader.at(19), IsNan());
  EXPECT_EQ(reader.at(20), 4);
  EXPECT_EQ(reader.at(29), 4);
  EXPECT_EQ(reader.at(1000), 3);
  EXPECT_THAT(CovariateReader(find_series(series, "c")).at(5), IsNan());
}

TEST(Covariates, ChecksNames) {
  const std::string longest(max_covariate_name_length, 'a');
  EXPECT_TRUE(is_valid_covariate_name("cpu_load"));
  EXPECT_TRUE(is_valid_covariate_name(longest + "=" + longest));
  EXPECT_FALSE(is_valid_covariate_name(longest + "a"));
  EXPECT_FALSE(is_valid_covariate_name("floor="));
  EXPECT_FALSE(is_valid_covariate_name("=ice"));
  EXPECT_FALSE(is_valid_covariate_name("floor=ice=thin"));
}

}  // namespace
}  // namespace joulecast::signals
