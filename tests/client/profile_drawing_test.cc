#include "client/profile_drawing.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace joulecast::client {
namespace {

using nlohmann::json;

json columns(double energy_j) {
  return {{"time_s", {0, 1, 2}},
          {"speed_m_s", {0, 1, 0}},
          {"yaw_rate_rad_s", {0, 0, 0}},
          {"power_w", {5, 9, nullptr}},
          {"energy_j", {0, 7, energy_j}}};
}

TEST(ProfileDrawing, DrawsPlanAndBaselines) {
  json answer{{"robot_id", "amr"}, {"energy_j", 10.0}, {"distance_m", 1.0}, {"profile", columns(10)}};
  answer["baselines"]["trapezoid"] = {
      {"energy_j", 12.5}, {"saving_fraction", 0.2}, {"within_limits", false}, {"profile", columns(12.5)}};
  answer["baselines"]["triangle"] = {{"energy_j", 13.0}, {"saving_fraction", 0.23}};
  const auto drawing = draw_answer(answer);
  ASSERT_TRUE(drawing) << describe(drawing.error());
  EXPECT_NE(drawing->find("least energy: 10.0 J"), std::string::npos);
  EXPECT_NE(drawing->find("trapezoid, as long on every run: 12.5 J; the plan saves 20.0 % (breaks"),
            std::string::npos);
  EXPECT_EQ(drawing->find("triangle, as"), std::string::npos);
}

TEST(ProfileDrawing, RejectsAnswerWithoutColumns) {
  json answer{{"robot_id", "amr"}, {"energy_j", 10.0}};
  EXPECT_EQ(draw_answer(answer).error().fault, Fault::corrupt);
  answer["profile"] = columns(10);
  answer["profile"]["power_w"] = {1, 2};
  EXPECT_EQ(draw_answer(answer).error().fault, Fault::corrupt);
}

}  // namespace
}  // namespace joulecast::client
