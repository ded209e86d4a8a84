#include "battery/recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

namespace joulecast::battery {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Recording, ReadsColumnsAndSplitsCycles) {
  const auto recordings = parse_recordings(
      "V_V,cycle,extra,t_s,I_A,T_C\r\n4.1,0,x,0,-0,25\r\n4.0,0,x,10,2,\r\n4.2,1,,0,0,26\r\n4.1,1,,5,1,27\r\n",
      "rw.csv");
  ASSERT_TRUE(recordings) << describe(recordings.error());
  ASSERT_EQ(recordings->size(), 2u);
  const Recording& first = recordings->front();
  EXPECT_EQ(first.name, "rw.csv#0");
  EXPECT_THAT(first.time_s, ElementsAre(0, 10));
  EXPECT_THAT(first.current_a, ElementsAre(0, 2));
  EXPECT_THAT(first.voltage_v, ElementsAre(4.1, 4.0));
  EXPECT_TRUE(std::isnan(first.temperature_c[1]));
  EXPECT_DOUBLE_EQ(first.charge_ah(), 20.0 / 3600);
  EXPECT_EQ((*recordings)[1].name, "rw.csv#1");
}

TEST(Recording, LastOfEqualTimesCounts) {
  const auto recordings = parse_recordings("t_s,I_A,V_V\n0,0,4\n10,1,3.9\n10,1,3.8\n", "x");
  ASSERT_TRUE(recordings);
  EXPECT_THAT(recordings->front().voltage_v, ElementsAre(4, 3.8));
}

TEST(Recording, RejectsDamagedTextWithPosition) {
  struct Case {
    const char* text;
    const char* field;
    const char* message;
  };
  for (const Case& item :
       {Case{"t_s,I_A\n0,0\n", "V_V", "header"}, Case{"t_s,I_A,V_V\n", "t_s", "no rows"},
        Case{"t_s,I_A,V_V\n0,0,4\n", "t_s", "single row"},
        Case{"t_s,I_A,V_V\n0,0,4\n1,x,4\n", "I_A", "line 3"},
        Case{"t_s,I_A,V_V\n0,0,4\n1,nan,4\n", "I_A", "line 3"},
        Case{"t_s,I_A,V_V\n0,0,4\n1,0\n", "line 3", "has 2 fields, the header 3"},
        Case{"t_s,I_A,V_V\n5,0,4\n1,0,4\n", "t_s", "line 3"}, Case{"", "line 1", "header"}}) {
    const auto recordings = parse_recordings(item.text, "x");
    ASSERT_FALSE(recordings) << item.text;
    EXPECT_EQ(recordings.error().field, item.field);
    EXPECT_THAT(recordings.error().message, HasSubstr(item.message));
  }
}

TEST(Recording, IgnoresBrokenLastLine) {
  const auto recordings = parse_recordings("t_s,I_A,V_V,T_C\n0,0,4,NaN\n10,1,3.9,25\n20,1,3.", "x");
  ASSERT_TRUE(recordings) << describe(recordings.error());
  EXPECT_THAT(recordings->front().time_s, ElementsAre(0, 10));
  EXPECT_TRUE(std::isnan(recordings->front().temperature_c[0]));
}

TEST(Recording, AcceptsSemicolonsAndQuotes) {
  const auto recordings = parse_recordings("\xEF\xBB\xBF\"t_s\";\"I_A\";V_V\n0;0;\"4\"\n\n10; 1;3.9\n", "x");
  ASSERT_TRUE(recordings) << describe(recordings.error());
  EXPECT_THAT(recordings->front().voltage_v, ElementsAre(4, 3.9));
}

TEST(Recording, AcceptsOtherColumnNames) {
  const auto recordings = parse_recordings("Time_s,Current_A,Voltage_V\n0,0,4\n10,1,3.9\n", "x");
  ASSERT_TRUE(recordings) << describe(recordings.error());
  EXPECT_THAT(recordings->front().current_a, ElementsAre(0, 1));
  EXPECT_TRUE(std::isnan(recordings->front().temperature_c[0]));
}

TEST(Recording, FindsFilesByPrefix) {
  namespace fs = std::filesystem;
  const fs::path folder =
      fs::temp_directory_path() / ("joulecast-cells-" + std::to_string(std::random_device{}()));
  fs::create_directories(folder);
  const auto names = [&](const std::string& given) {
    std::vector<std::string> out;
    const auto files = identification_files(given);
    if (!files) return out;
    for (const fs::path& file : *files) out.push_back(file.filename().string());
    return out;
  };
  const auto put = [&](const char* name) { std::ofstream(folder / name) << "t_s,I_A,V_V\n"; };
  for (const char* name : {"X_slow.csv", "X_pulse.csv", "X_rw.csv", "Y_slow.csv"}) put(name);
  EXPECT_THAT(names((folder / "X").string()), ElementsAre("X_pulse.csv", "X_slow.csv"));
  EXPECT_THAT(names((folder / "X_").string()), ElementsAre("X_pulse.csv", "X_slow.csv"));
  put("X_ocv_data.csv");
  EXPECT_THAT(names((folder / "X").string()), ElementsAre("X_ocv_data.csv"));
  EXPECT_THAT(names(folder.string()), ElementsAre("X_ocv_data.csv"));
  const auto discharges = [&](const std::string& given) {
    return discharge_files(given).value().at(0).filename();
  };
  EXPECT_EQ(discharges((folder / "X").string()), "X_rw.csv");
  EXPECT_EQ(discharges(folder.string()), "X_rw.csv");
  EXPECT_EQ(discharges((folder / "Y_slow.csv").string()), "Y_slow.csv");
  EXPECT_THAT(discharge_files((folder / "Y").string()).error().message, HasSubstr("no random discharges"));
  EXPECT_THAT(read_recordings(folder).error().message, HasSubstr("folder"));
  put("Y_ocv_data.csv");
  EXPECT_THAT(identification_files(folder.string()).error().message, HasSubstr("several batteries, X to Y"));
  fs::remove_all(folder);
}

TEST(Recording, UnknownPrefixIsNotFound) {
  EXPECT_EQ(identification_files("/nowhere/R1").error().fault, Fault::not_found);
  EXPECT_EQ(read_recordings("/nowhere/R1.csv").error().fault, Fault::not_found);
}

}  // namespace
}  // namespace joulecast::battery
