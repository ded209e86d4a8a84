#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "client/commands/print.h"

namespace joulecast::client {
namespace {

using nlohmann::json;

TEST(PrintAutonomy, ExplainsUnreachablePace) {
  const json quantiles = {{"p05", nullptr}, {"p50", nullptr}, {"p95", nullptr}};
  json answer = {{"robot_id", "amr"},
                 {"charging", nullptr},
                 {"driving", "usual"},
                 {"pace", {{"speed_m_s", 0}, {"limitation", nullptr}}},
                 {"consumption", {{"basis", "model"}}},
                 {"range_quantiles_m", quantiles},
                 {"run_time_quantiles_s", quantiles},
                 {"drift", nullptr},
                 {"plan", nullptr},
                 {"minimum_energy", nullptr}};
  const auto printed = [&] {
    ::testing::internal::CaptureStdout();
    print_autonomy(answer, "Wh");
    return ::testing::internal::GetCapturedStdout();
  };
  EXPECT_THAT(printed(), ::testing::Not(::testing::HasSubstr("cannot drive")));
  EXPECT_THAT(printed(), ::testing::Not(::testing::HasSubstr("A typical curve")));
  answer["state_of_charge_limitation"] = "A typical curve is used.";
  EXPECT_THAT(printed(), ::testing::HasSubstr("\nA typical curve is used.\n"));
  answer["pace"]["limitation"] = "With 0 kg the robot cannot drive.";
  EXPECT_THAT(printed(), ::testing::HasSubstr("\nWith 0 kg the robot cannot drive.\n"));
}

TEST(PrintAutonomy, ReportsFleetsWithoutModels) {
  ::testing::internal::CaptureStdout();
  print_autonomy({{"robots", json::array()}}, "Wh");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "no robot has a model\n");
}

}  // namespace
}  // namespace joulecast::client
