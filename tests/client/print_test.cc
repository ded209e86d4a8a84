#include "client/commands/print.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace joulecast::client {
namespace {

template <class Print>
std::string output_of(Print print) {
  ::testing::internal::CaptureStdout();
  print();
  return ::testing::internal::GetCapturedStdout();
}

TEST(PrintRows, AlignsNumbersRight) {
  const Json rows = {{{"name", "tour"}, {"energy", {{"wh", 3.14159}}}, {"at", "2026-11-22T16:45:00.25Z"}},
                     {{"name", "\xC3\xA4"}, {"energy", {{"wh", 1234.5}}}, {"at", nullptr}},
                     {{"name", 7}}};
  EXPECT_EQ(output_of([&] {
              print_rows(rows, {{"name", "name"},
                                {"mWh", "energy/wh", 1, 1e3},
                                time_column("at", "at"),
                                text_column("size", [](const Json& r) { return std::to_string(r.size()); })});
            }),
            "name        mWh  at                   size\n"
            "tour     3141.6  2026-11-22 16:45:00  3\n"
            "\xC3\xA4     1234500.0  -                    3\n"
            "7             -  -                    1\n");
}

TEST(PrintRows, ReportsEmptyTable) {
  EXPECT_EQ(output_of([] { print_rows(Json(), {{"name", "name"}}, "no robot"); }), "name\nno robot\n");
}

TEST(PrintMissions, MarkPartlyMeasured) {
  const auto mission = [](double measured_s, bool incomplete, const Json& annulled) {
    return Json{{"state", "finished"},
                {"incomplete", incomplete},
                {"annulled", annulled},
                {"energy", {{"measured_s", measured_s}, {"duration_s", 300}}}};
  };
  const auto printed = [](const Json& missions) {
    return output_of([&] { print_missions(missions, {{"state", "state"}}); });
  };
  EXPECT_EQ(printed({mission(300, false, {}), mission(300, true, {})}), "state\nfinished\nfinished*\n");
  EXPECT_EQ(printed({mission(260, true, {}), mission(0, false, {}), mission(0, false, "sensor")}),
            "state\nfinished*~\nfinished~\nannulled\n"
            "~ = battery power was measured for only a part of the time, or not at all\n");
}

TEST(NumberText, DropsSignOfZero) {
  EXPECT_EQ(number_text(-0.04, 1), "0.0");
  EXPECT_EQ(number_text(-0.06, 1), "-0.1");
  EXPECT_EQ(without_sign_of_zero("+0.0 %"), "0.0 %");
  EXPECT_EQ(without_sign_of_zero("+10.0 %"), "+10.0 %");
}

TEST(EnergyText, ConvertsUnits) {
  EXPECT_EQ(energy_text(3600, "Wh"), "1.000");
  EXPECT_EQ(energy_text(-36, "Wh"), "-0.0100");
  EXPECT_EQ(energy_text(1'286'102, "Wh"), "357.3");
  EXPECT_EQ(energy_text(2364.636, "J"), "2364.64");
  EXPECT_EQ(energy_text(1'286'102, "J"), "1286102");
  EXPECT_EQ(energy_text(std::nan(""), "Wh"), "-");
  EXPECT_EQ(energy_per_way_text(36, "Wh"), "10.0 Wh/km");
  EXPECT_EQ(energy_per_way_text(36, "J"), "36.0 J/m");
}

TEST(LedgerTerms, PrintRecoveredNegativeWithoutZeros) {
  const Json terms = {{"copper", 75}, {"kinetic", 0.001}, {"recovered", 25}};
  EXPECT_EQ(output_of([&] { print_ledger_terms(terms, 50, "J"); }),
            "  copper                      75.00 J   150.0 %\n"
            "  recovered                  -25.00 J   -50.0 %\n");
}

TEST(BackTest, OmitsFiguresWithoutMissions) {
  const Json test = {{"missions", Json::array()}, {"error_before", nullptr}, {"improves", false}};
  EXPECT_EQ(output_of([&] { print_back_test(test, "Wh"); }), "");
}

TEST(BackTest, PrintsIntervalsOnlyIfPresent) {
  Json test = {{"missions",
                {{{"mission_id", "m1"},
                  {"measured_j", 7200},
                  {"before", {{"relative", 0.08}}},
                  {"after", {{"relative", -0.01}}}}}},
               {"error_before", 0.08},
               {"error_after", 0.01},
               {"power_gap_before", 0.2},
               {"power_gap_after", nullptr},
               {"improves", true}};
  const std::string without = output_of([&] { print_back_test(test, "Wh"); });
  EXPECT_NE(without.find("energy error 8.00 % -> 1.00 %\npower gap 20.00 % -> - %\nit improves\n"),
            std::string::npos)
      << without;
  EXPECT_NE(without.find("m1                       2.000            8.00          -1.00\n"),
            std::string::npos)
      << without;
  test["improvement_ci"] = {0.05, 0.09};
  EXPECT_NE(output_of([&] { print_back_test(test, "Wh"); }).find("falls by 7.00 % [5.00, 9.00]"),
            std::string::npos);
}

}  // namespace
}  // namespace joulecast::client
