#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/import_csv.h"

namespace joulecast::telemetry {
namespace {

using ::testing::HasSubstr;

// A mapping with the given members. Wheels are read from columns r and l unless `fields` replaces them.
std::string mapping_text(const std::string& members, const std::string& fields = "") {
  return R"({"robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "s"},)" + members +
         R"("fields": {"wheel_velocity": [{"column": "r"}, {"column": "l"}])" + fields + "}}";
}

ImportMapping mapping_of(const std::string& members, const std::string& fields = "") {
  auto mapping = ImportMapping::parse(mapping_text(members, fields));
  EXPECT_TRUE(mapping) << describe(mapping.error());
  return mapping.value();
}

std::vector<double> battery_voltages(const std::string& csv, const std::string& members,
                                     const std::string& field) {
  auto import = import_csv(csv, mapping_of(members, R"(, "battery_voltage": )" + field));
  EXPECT_TRUE(import) << describe(import.error());
  std::vector<double> values;
  if (import) {
    for (const signals::Sample& sample : import->recording.samples)
      values.push_back(sample.battery_voltage_v);
  }
  return values;
}

std::string mapping_fault(const std::string& json) {
  const auto mapping = ImportMapping::parse(json);
  return mapping ? "accepted" : mapping.error().field;
}

TEST(CsvImport, ReadsTimesAndNames) {
  const auto import =
      import_csv("t,r,l\n0.5,1,2\n0.75,3,4\n", mapping_of(R"("payload_kg": 5, )"),
                 {.source_name = "x.csv", .robot_id = {}, .mission_id = {}, .start_utime_us = {}});
  ASSERT_TRUE(import) << describe(import.error());
  const Recording& recording = import->recording;
  EXPECT_EQ(recording.robot_id, "r");
  EXPECT_EQ(recording.mission_id, "m");
  EXPECT_EQ(recording.payload_kg, 5);
  ASSERT_EQ(recording.samples.size(), 2u);
  EXPECT_EQ(recording.samples[0].utime_us, 500'000);
  EXPECT_EQ(recording.samples[1].utime_us, 750'000);
  EXPECT_EQ(recording.samples[1].sequence, 1);
  EXPECT_EQ(recording.samples[1].wheel_velocity_rad_s, (std::array<double, 2>{3, 4}));
  EXPECT_EQ(recording.samples[1].payload_kg, 5);
  EXPECT_TRUE(std::isnan(recording.samples[1].battery_voltage_v));
}

TEST(CsvImport, ReadsChangingPayload) {
  auto mapping = mapping_of(R"("empty_cells": "unmeasured", )", R"(, "payload_mass": {"column": "kg"})");
  const auto import = import_csv("t,r,l,kg\n0.5,1,2,0\n0.75,3,4,\n1,3,4,20\n", mapping);
  ASSERT_TRUE(import) << describe(import.error());
  EXPECT_TRUE(std::isnan(import->recording.payload_kg));
  EXPECT_EQ(import->recording.samples[0].payload_kg, 0);
  EXPECT_TRUE(std::isnan(import->recording.samples[1].payload_kg));
  EXPECT_EQ(import->recording.samples[2].payload_kg, 20);
}

TEST(CsvImport, UsesCallerNamesAndStart) {
  ImportOptions options{"data/ICE/run_1.csv", "robot-9", "{folder}-{stem}", 1'700'000'000'000'000};
  const auto import = import_csv("t,r,l\n7,1,2\n8,3,4\n", mapping_of(""), options);
  ASSERT_TRUE(import) << describe(import.error());
  EXPECT_EQ(import->recording.robot_id, "robot-9");
  EXPECT_EQ(import->recording.mission_id, "ICE-run_1");
  EXPECT_EQ(import->recording.samples[0].utime_us, 1'700'000'000'000'000);
  EXPECT_EQ(import->recording.samples[1].utime_us, 1'700'000'001'000'000);
  options.mission_id = "no/such/id";
  EXPECT_EQ(import_csv("t,r,l\n7,1,2\n", mapping_of(""), options).error().field, "mission_id");
}

TEST(CsvImport, NanosecondsStayExact) {
  const auto mapping = ImportMapping::parse(R"({"robot_id": "r", "mission_id": "m",
      "time": {"column": "t", "unit": "ns"}, "fields": {"wheel_velocity": [{"column": "r"}, {"column": "l"}]}})");
  const auto import = import_csv("t,r,l\n1721335045320405150,1,2\n", *mapping);
  ASSERT_TRUE(import) << describe(import.error());
  EXPECT_EQ(import->recording.samples[0].utime_us, 1'721'335'045'320'405);
}

TEST(CsvImport, HandlesEmptyCells) {
  const std::string csv = "t,r,l,v\n0,1,1,\n1,1,1,5\n2,1,1,\n";
  EXPECT_THAT(battery_voltages(csv, "", R"({"column": "v"})"),
              ::testing::ElementsAre(::testing::IsNan(), 5, 5));
  EXPECT_THAT(battery_voltages(csv, R"("empty_cells": "unmeasured", )", R"({"column": "v"})"),
              ::testing::ElementsAre(::testing::IsNan(), 5, ::testing::IsNan()));
}

TEST(CsvImport, SkipsRowsBeforeBothWheels) {
  const auto import = import_csv("t,r,l\n0,1,\n1,,\n2,,3\n3,2,\n", mapping_of(""));
  ASSERT_TRUE(import);
  EXPECT_EQ(import->report.rows, 4u);
  EXPECT_EQ(import->report.rows_without_motion, 2u);
  EXPECT_EQ(import->report.samples, 2u);
  EXPECT_EQ(import->recording.samples[0].utime_us, 2'000'000);
  EXPECT_EQ(import->recording.samples[0].sequence, 0);
  // Row 2 repeats r; row 3 repeats r; row 4 repeats l.
  EXPECT_EQ(import->report.cells_filled, 3u);
}

TEST(CsvImport, CountsRowsWithoutTimeAdvance) {
  const auto import = import_csv("t,r,l\n1,1,1\n1,2,2\n2,4,4\n", mapping_of(""));
  ASSERT_TRUE(import);
  EXPECT_EQ(import->report.rows_out_of_time, 1u);
  EXPECT_EQ(import->report.rows_unsorted, 0u);
  EXPECT_EQ(import->recording.samples[1].wheel_velocity_rad_s[0], 4);
}

TEST(CsvImport, SortsRowsByTime) {
  const auto import = import_csv("t,r,l\n3,3,3\n1,1,1\n2,,2\n2,7,7\n", mapping_of(""));
  ASSERT_TRUE(import);
  EXPECT_EQ(import->report.rows_unsorted, 3u);
  EXPECT_EQ(import->report.rows_out_of_time, 1u);
  const auto& samples = import->recording.samples;
  ASSERT_EQ(samples.size(), 3u);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(samples[k].utime_us, 1'000'000 * static_cast<std::int64_t>(k + 1));
    EXPECT_EQ(samples[k].wheel_velocity_rad_s[1], static_cast<double>(k + 1));
  }
  EXPECT_EQ(samples[1].wheel_velocity_rad_s[0], 1);  // held from the previous row in time
  // Line numbers are those of the file.
  EXPECT_THAT(import_csv("t,r,l\n3,3,3\n1,x,1\n", mapping_of("")).error().field,
              ::testing::HasSubstr("line 3"));
  EXPECT_THAT(import_csv("t,r,l\n3,3,3\nx,1,1\n1,1,1\n", mapping_of("")).error().field,
              ::testing::HasSubstr("line 3"));
}

TEST(CsvImport, MostCellsShowDecimalSign) {
  const auto mapping = mapping_of(R"("separator": ";", )");
  const auto first_right = [&](const std::string& row) {
    return import_csv("t;r;l;version\n" + row, mapping).value().recording.samples[0].wheel_velocity_rad_s[0];
  };
  EXPECT_EQ(first_right("0,5;1,25;1;2.1\n"), 1.25);
  EXPECT_EQ(first_right("0.5;1.25;1;2,1\n"), 1.25);
}

TEST(CsvImport, EvaluatesExpressionsInOrder) {
  const std::string csv = "t,r,l,a,b\n0,1,1,3,-7\n";
  const std::pair<const char*, double> cases[] = {
      {R"({"column": "a"})", 3},
      {R"({"columns": ["a", "b"]})", -4},
      {R"({"columns": ["a", {"column": "b", "negate": true}]})", 10},
      {R"({"columns": ["a", "b"], "combine": "mean"})", -2},
      {R"({"columns": ["a", "b"], "negate": true, "scale": 6, "divide_by": 4})", 6},
      {R"({"column": "a", "sign_from": ["b"]})", -3},
      {R"({"column": "b", "sign_from": ["b"]})", 7},
      {R"({"column": "a", "sign_from": [{"column": "b", "negate": true}]})", 3},
      {R"({"constant": 24})", 24},
      {R"({"constant": 24, "sign_from": ["b"]})", -24},
  };
  for (const auto& [expression, expected] : cases) {
    EXPECT_THAT(battery_voltages(csv, "", expression), ::testing::ElementsAre(expected)) << expression;
  }
}

TEST(CsvImport, SignComesFromFirstReference) {
  EXPECT_THAT(battery_voltages("t,r,l,a,s,u\n0,1,1,5,0,-2\n1,1,1,5,0,0\n2,1,1,5,3,-2\n3,1,1,5,nan,-1\n", "",
                               R"({"column": "a", "sign_from": ["s", "u"]})"),
              ::testing::ElementsAre(-5, 5, 5, -5));
}

TEST(CsvImport, ConvertsQuaternionToYaw) {
  const double angle = 2.5;
  const std::string csv = "t,r,l,x,y,z,w\n0,1,1,0,0," + std::to_string(std::sin(angle / 2)) + "," +
                          std::to_string(std::cos(angle / 2)) + "\n";
  const auto import =
      import_csv(csv, mapping_of("", R"(, "pose": [null, null, {"quaternion_yaw": ["x", "y", "z", "w"]}])"));
  ASSERT_TRUE(import);
  // std::to_string prints six decimals: each half-angle component is off by 5e-7 at most, the angle by twice
  // their sum.
  EXPECT_NEAR(import->recording.samples[0].pose[2], angle, 2e-6);
  EXPECT_TRUE(std::isnan(import->recording.samples[0].pose[0]));
}

TEST(CsvImport, ReportsGlitchesByPolicy) {
  const std::string csv = "t,r,l,v\n0,1,1,5\n1,1,1,-62.7\n2,1,1,6\n";
  const auto limited = [](const std::string& policy) {
    return R"("column_limits": {"v": {"low": 0, "high": 50, "outside": ")" + policy + R"("}}, )";
  };
  const std::string field = R"({"column": "v"})";
  EXPECT_THAT(battery_voltages(csv, limited("hold"), field), ::testing::ElementsAre(5, 5, 6));
  EXPECT_THAT(battery_voltages(csv, limited("unmeasured"), field),
              ::testing::ElementsAre(5, ::testing::IsNan(), 6));

  const auto import = import_csv(csv, mapping_of(limited("hold"), R"(, "battery_voltage": {"column": "v"})"));
  ASSERT_TRUE(import);
  ASSERT_EQ(import->report.glitches.size(), 1u);
  EXPECT_EQ(import->report.glitches[0].line, 3u);
  EXPECT_EQ(import->report.glitches[0].column, "v");
  EXPECT_EQ(import->report.glitches[0].value, -62.7);
  EXPECT_EQ(import->report.glitches[0].action, "hold");
}

TEST(CsvImport, TreatsInfinityAsGlitch) {
  const std::string csv = "t,r,l,v\n0,1,1,inf\n";
  const auto import = import_csv(csv, mapping_of("", R"(, "battery_voltage": {"column": "v"})"));
  ASSERT_TRUE(import);
  EXPECT_TRUE(std::isnan(import->recording.samples[0].battery_voltage_v));
  EXPECT_EQ(import->report.glitches.size(), 1u);
}

// A limit on one side, in the main table and in a joined one.
TEST(CsvImport, OneSidedLimitsExcludeInfinity) {
  const std::string limits =
      R"("column_limits": {"v": {"low": 0, "outside": "unmeasured"}, "b:v": {"low": 0, "outside": "hold"}},
         "tables": {"b": {"file": "b.csv", "tolerance_s": 9, "time": {"column": "t", "unit": "s"}}}, )";
  ImportOptions options{"x.csv", {}, {}, {}};
  options.read_file = [](const std::string&) { return Result<std::string>("t,v\n0,7\n1,inf\n2,-1\n3,8\n"); };
  const auto import = import_csv(
      "t,r,l,v\n0,1,1,5\n1,1,1,inf\n2,1,1,-inf\n3,1,1,6\n",
      mapping_of(limits, R"(, "battery_voltage": {"column": "v"}, "battery_current": {"column": "b:v"})"),
      options);
  ASSERT_TRUE(import) << describe(import.error());
  using ::testing::IsNan;
  std::vector<double> volts, amperes;
  for (const signals::Sample& sample : import->recording.samples) {
    volts.push_back(sample.battery_voltage_v);
    amperes.push_back(sample.battery_current_a);
  }
  EXPECT_THAT(volts, ::testing::ElementsAre(5, IsNan(), IsNan(), 6));
  EXPECT_THAT(amperes, ::testing::ElementsAre(7, 7, 7, 8));
  EXPECT_EQ(import->report.glitches.size(), 4u);
}

TEST(CsvImport, TriesPrefixAfterPlainName) {
  const auto import = import_csv("t,p/r,p/l,l\n0,1,2,3\n", mapping_of(R"("column_prefix": "p/", )"));
  ASSERT_TRUE(import) << describe(import.error());
  EXPECT_EQ(import->recording.samples[0].wheel_velocity_rad_s, (std::array<double, 2>{1, 3}));
}

TEST(CsvImport, RejectsUnmetRequirements) {
  const ImportMapping mapping = mapping_of(R"("require": {"gear": "high"}, )");
  EXPECT_TRUE(import_csv("t,r,l,gear\n0,1,1,\n1,1,1,high\n", mapping));
  const auto refused = import_csv("t,r,l,gear\n0,1,1,high\n1,1,1,low\n", mapping, {"x.csv", {}, {}, {}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "x.csv: line 3");
  EXPECT_THAT(refused.error().message, HasSubstr("gear"));
}

TEST(CsvImport, ErrorsNameLineAndColumn) {
  const ImportOptions options{"x.csv", {}, {}, {}};
  const auto import = import_csv("t,r,l\n0,1,1\n1,1,fast\n", mapping_of(""), options);
  ASSERT_FALSE(import);
  EXPECT_EQ(import.error().field, "x.csv: line 3");
  EXPECT_EQ(import.error().message,
            R"(column 'l': 'fast' is no number; "no_value" lists words for no value)");
  EXPECT_THAT(import_csv("t,r,l\nnoon,1,1\n", mapping_of("")).error().message, HasSubstr("is no time"));
  EXPECT_THAT(import_csv("t,r,l\n,1,1\n", mapping_of("")).error().message, HasSubstr("is no time"));
  EXPECT_THAT(import_csv("t,r,l\n-1,1,1\n", mapping_of("")).error().message, HasSubstr("1970"));
  EXPECT_THAT(import_csv("t,r,l\n9223372036854775807,1,1\n", mapping_of("")).error().message,
              HasSubstr("later than the year 2100"));
  EXPECT_THAT(import_csv("t,r\n0,1\n", mapping_of("")).error().message, HasSubstr("'l' is missing"));
  EXPECT_THAT(import_csv("t,r,l\n0,,\n", mapping_of("")).error().message,
              HasSubstr("1 of 1 rows of missions would be lost: 0 have the time"));
  EXPECT_THAT(import_csv("t,r,l\n", mapping_of("")).error().message, HasSubstr("no row of numbers"));
  const ImportOptions before_1970{"x.csv", {}, {}, -1'000'000};
  EXPECT_THAT(import_csv("t,r,l\n7,1,1\n", mapping_of(""), before_1970).error().message,
              HasSubstr("'1969-12-31T23:59:59Z' is not between the years 1970 and 2100"));
}

const signals::CovariateSeries& series_called(const Recording& recording, const std::string& name) {
  static const signals::CovariateSeries none;
  const signals::CovariateSeries* found = signals::find_series(recording.covariates, name);
  EXPECT_NE(found, nullptr) << name;
  return found == nullptr ? none : *found;
}

// A height every 2 s, and none after 4 s: held for ten of its periods.
TEST(CsvImport, HoldsSlowCovariates) {
  std::string csv = "t,r,l,z\n";
  for (int k = 0; k < 40; ++k)
    csv += fmt::format("{},1,1,{}\n", k, k % 2 == 0 && k <= 4 ? fmt::to_string(k) : "");
  const auto import = import_csv(
      csv, mapping_of(R"("empty_cells": "unmeasured", "covariates": {"height_m": {"column": "z"}}, )"));
  ASSERT_TRUE(import) << describe(import.error());
  const signals::CovariateSeries& height = series_called(import->recording, "height_m");
  EXPECT_THAT(height.value, ::testing::ElementsAre(0, 2, 4, ::testing::IsNan()));
  EXPECT_THAT(height.utime_us, ::testing::ElementsAre(0, 2'000'000, 4'000'000, 25'000'000));
}

TEST(CsvImport, WritesCovariatesOnChange) {
  const std::string csv =
      "t,r,l,load,z\n0,1,1,,7\n1,1,1,50,7\n2,1,1,50,7.5\n3,1,1,nan,7.5\n4,1,1,75,\n5,1,1,75,9\n";
  const auto import =
      import_csv(csv, mapping_of(R"("covariates": {"cpu_load": {"column": "load", "divide_by": 100},
                                         "height_m": {"column": "z"}, "ambient_c": {"constant": 21}}, )"));
  ASSERT_TRUE(import) << describe(import.error());
  const Recording& recording = import->recording;
  EXPECT_EQ(recording.covariates.size(), 3u);
  const signals::CovariateSeries& load = series_called(recording, "cpu_load");
  EXPECT_THAT(load.utime_us, ::testing::ElementsAre(1'000'000, 3'000'000, 4'000'000));
  EXPECT_THAT(load.value, ::testing::ElementsAre(0.5, ::testing::IsNan(), 0.75));
  EXPECT_THAT(series_called(recording, "height_m").utime_us, ::testing::ElementsAre(0, 2'000'000, 5'000'000));
  EXPECT_THAT(series_called(recording, "ambient_c").value, ::testing::ElementsAre(21));
}

std::vector<Import> missions_of(const std::string& csv, const std::string& mapping,
                                const ImportOptions& options = {}) {
  const auto parsed = ImportMapping::parse(mapping);
  EXPECT_TRUE(parsed) << describe(parsed.error());
  auto missions = import_missions(csv, parsed.value(), options);
  EXPECT_TRUE(missions) << describe(missions.error());
  return missions ? std::move(*missions) : std::vector<Import>{};
}

const std::string wheels = R"("fields": {"wheel_velocity": [{"column": "r"}, {"column": "l"}])";

TEST(CsvImport, ReadsIsoStamps) {
  const auto first_us = [](const std::string& stamp, const std::string& more) {
    const auto mapping = ImportMapping::parse(
        R"({"robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "iso8601")" + more + "}, " +
        wheels + "}}");
    EXPECT_TRUE(mapping) << describe(mapping.error());
    const auto read = import_csv("t,r,l\n\"" + stamp + "\",1,2\n", mapping.value());
    return read ? read->recording.samples[0].utime_us : std::int64_t{-1};
  };
  constexpr std::int64_t eight = 1'772'352'000'250'000;  // 2026-03-01 08:00:00.25 UTC
  EXPECT_EQ(first_us("2026-03-01T08:00:00.25Z", ""), eight);
  EXPECT_EQ(first_us("2026-03-01T09:00:00.25+01:00", ""), eight);
  EXPECT_EQ(first_us("2026-03-01 03:00:00,25-05:00", ""), eight);
  EXPECT_EQ(first_us("2026-03-01 09:00:00.25", R"(, "utc_offset": "+01:00")"), eight);
  EXPECT_EQ(first_us("2026-03-01T08:00:00.25Z", R"(, "utc_offset": "+01:00")"), eight);
  EXPECT_EQ(first_us("2026-03-01 09:00:00.25", ""), -1);
  EXPECT_EQ(first_us("yesterday", ""), -1);
}

TEST(CsvImport, ReadsEveryTableStyle) {
  const auto samples = [](const std::string& csv, const std::string& layout) {
    const auto missions = missions_of(csv, R"({"robot_id": "r", "mission_id": "m", )" + layout +
                                               R"(, "time": {"column": "t", "unit": "s"}, )" + wheels + "}}");
    std::vector<double> rights;
    for (const Import& one : missions)
      for (const signals::Sample& sample : one.recording.samples)
        rights.push_back(sample.wheel_velocity_rad_s[0] + sample.wheel_velocity_rad_s[1]);
    return rights;
  };
  EXPECT_THAT(samples("% made by hand\nt,r,l\n0,1,2\n# pause\n1,3,4\n", R"("comment": "%#")"),
              ::testing::ElementsAre(3, 7));
  EXPECT_THAT(samples("0 1\t2\n  1   3 4  \n", R"("separator": "blanks", "header": ["t", "r", "l"])"),
              ::testing::ElementsAre(3, 7));
  EXPECT_THAT(samples("t;r;l\n0,5;1,25;2\n1,5;3;-4,5e1\n", R"("separator": ";")"),
              ::testing::ElementsAre(3.25, -42));
  EXPECT_THAT(samples("a logger\n\n3 rows follow\nt,r,l\n0,1,2\n", R"("skip_lines": 3)"),
              ::testing::ElementsAre(3));
}

TEST(CsvImport, EvaluatesMeansAndQuotients) {
  const std::string csv = "t,r,l,p,v,z\n0,1,1,240,24,0\n1,1,1,250,25,0\n";
  EXPECT_THAT(battery_voltages(csv, "", R"({"column": "p", "over": ["v"]})"), ::testing::ElementsAre(10, 10));
  EXPECT_THAT(battery_voltages(csv, "", R"({"column": "p", "over": ["z"]})"),
              ::testing::Each(::testing::IsNan()));
  EXPECT_THAT(battery_voltages(csv, "", R"({"columns": ["p", "v"], "combine": "mean"})"),
              ::testing::ElementsAre(132, 137.5));
  EXPECT_THAT(battery_voltages(csv, "", R"({"columns": ["p", {"column": "v", "scale": -0.5}]})"),
              ::testing::ElementsAre(228, 237.5));
}

// Counts of a 16-bit encoder that turns evenly, then half as fast, with clock jitter.
TEST(CsvImport, PositionsBecomeSpeeds) {
  std::string csv = "t,r,l\n";
  double counts = 65'000;
  for (int k = 0; k < 200; ++k) {
    csv += std::to_string(0.02 * k) + "," + std::to_string(std::fmod(counts, 65'536)) + "," +
           std::to_string(-0.1 * k) + "\n";
    counts += k < 100 ? 40 : 20;
  }
  const auto missions = missions_of(
      csv,
      R"({"robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "s"}, "fields": {"wheel_velocity": [
      {"column": "r", "divide_by": 100, "wraps_at": 65536, "rate": {"window_s": 0.1}}, {"column": "l", "rate": {}}]}})");
  ASSERT_EQ(missions.size(), 1u);
  const auto& samples = missions[0].recording.samples;
  ASSERT_EQ(samples.size(), 200u);
  for (const std::size_t k : {0u, 10u, 50u, 90u})
    EXPECT_NEAR(samples[k].wheel_velocity_rad_s[0], 20, 1e-6) << k;
  for (const std::size_t k : {110u, 150u, 199u})
    EXPECT_NEAR(samples[k].wheel_velocity_rad_s[0], 10, 1e-6) << k;
  for (const signals::Sample& sample : samples) EXPECT_NEAR(sample.wheel_velocity_rad_s[1], -5, 1e-6);
}

TEST(CsvImport, ColumnNamesMissions) {
  const std::string csv =
      "t,r,l,run,v\n0,1,1,a b,5\n1,1,1,a b,5\n2,1,1,,5\n3,1,1,c,6\n4,1,1,c,6\n5,1,1,a b,7\n";
  const auto mapping = [](const std::string& cells) {
    return R"({"robot_id": "r", "mission": {"column": "run"}, "time": {"column": "t", "unit": "s"}, )" +
           cells + R"("covariates": {"v": {"column": "v"}}, )" + wheels + "}}";
  };
  const auto held = missions_of(csv, mapping(""));
  ASSERT_EQ(held.size(), 3u);
  EXPECT_EQ(held[0].recording.mission_id, "a_b");
  EXPECT_EQ(held[0].recording.samples.size(), 3u);
  EXPECT_EQ(held[1].recording.mission_id, "c");
  EXPECT_EQ(held[2].recording.mission_id, "a_b-2");
  // Values from before the mission stay in force in it.
  EXPECT_THAT(signals::find_series(held[1].recording.covariates, "v")->utime_us,
              ::testing::ElementsAre(3'000'000));
  const auto blank = missions_of(csv, mapping(R"("empty_cells": "unmeasured", )"));
  ASSERT_EQ(blank.size(), 3u);
  EXPECT_EQ(blank[0].recording.samples.size(), 2u);
  EXPECT_THAT(blank[0].report.notes, ::testing::ElementsAre("1 rows belong to no mission"));
}

TEST(CsvImport, JoinsTablesOfOtherRates) {
  std::string csv = "t,r,l\n";
  for (int k = 0; k < 50; ++k) csv += std::to_string(10 + 0.1 * k) + ",1,1\n";
  ImportOptions options{"data/run.csv", {}, "m", {}};
  // Its rows are unordered, its clock counts ms, and it ends early.
  options.read_file = [](const std::string& path) {
    EXPECT_EQ(path, "data/run_battery.txt");
    return Result<std::string>("ms volt\n10000 24\n11000 26\n10500 25\n12000 27\n");
  };
  const std::string mapping =
      R"({"robot_id": "r", "time": {"column": "t", "unit": "s"}, "tables": {"battery": {"file": "{stem}_battery.txt",
      "separator": "blanks", "tolerance_s": 1.2, "time": {"column": "ms", "unit": "ms"}}}, )" +
      wheels + R"(, "battery_voltage": {"column": "battery:volt"}}})";
  const auto parsed = ImportMapping::parse(mapping).value();
  const auto held = missions_of(csv, mapping, options);
  ASSERT_EQ(held.size(), 1u);
  const auto& samples = held[0].recording.samples;
  ASSERT_EQ(samples.size(), 50u);
  EXPECT_EQ(samples[0].battery_voltage_v, 24);
  EXPECT_EQ(samples[4].battery_voltage_v, 24);
  EXPECT_EQ(samples[15].battery_voltage_v, 26);
  EXPECT_TRUE(std::isnan(samples[33].battery_voltage_v));  // 1.3 s after the last
  ASSERT_EQ(held[0].report.joins.size(), 1u);
  const JoinReport& join = held[0].report.joins[0];
  EXPECT_EQ(join.rows, 4u);
  EXPECT_EQ(join.matched, 33u);
  EXPECT_EQ(join.beyond_tolerance, 17u);
  EXPECT_NEAR(join.median_lag_s, 0.4, 0.11);

  options.read_file = {};
  EXPECT_EQ(import_missions(csv, parsed, options).error().field, "/tables/battery");
}

// What becomes of a table under a mapping with these members of time, and wheels from r and l.
Result<std::vector<Import>> read_table(const std::string& csv, const std::string& time,
                                       const std::string& more = "", ImportOptions options = {}) {
  const auto mapping =
      ImportMapping::parse(R"({"robot_id": "r", "mission_id": "m", "time": {)" + time + "}, " + more +
                           wheels + R"(, "battery_voltage": {"column": "v"}}})");
  EXPECT_TRUE(mapping) << describe(mapping.error());
  options.source_name = "x.csv";
  return import_missions(csv, mapping.value(), options);
}

const std::string in_seconds = R"("column": "t", "unit": "s")";

// Rows at t, with a wheel speed that no row before has.
std::string rows_at(const std::vector<double>& times) {
  std::string csv = "t,r,l,v\n";
  for (std::size_t k = 0; k < times.size(); ++k)
    csv += std::to_string(times[k]) + "," + std::to_string(k) + ",1,25\n";
  return csv;
}

TEST(ImportTime, RestartedClockBeginsMission) {
  ImportOptions from{
      .source_name = {}, .robot_id = {}, .mission_id = {}, .start_utime_us = 1'700'000'000'000'000};
  from.pause_us = 30'000'000;
  std::vector<double> twice;
  for (int k = 0; k < 100; ++k) twice.push_back(0.1 * (k % 60));
  const auto missions = read_table(rows_at(twice), in_seconds, "", from);
  ASSERT_TRUE(missions) << describe(missions.error());
  ASSERT_EQ(missions->size(), 2u);
  EXPECT_EQ((*missions)[0].report.rows, 60u);
  EXPECT_EQ((*missions)[1].report.rows, 40u);
  EXPECT_EQ((*missions)[1].recording.mission_id, "m-2");
  EXPECT_EQ((*missions)[1].recording.samples[0].utime_us - (*missions)[0].recording.samples.back().utime_us,
            30'000'000);
  ASSERT_EQ((*missions)[0].report.notes.size(), 1u);
  EXPECT_THAT((*missions)[0].report.notes[0], HasSubstr("line 62: the time goes back by 5.9 s"));
  // Rows of two drives that lie between each other, and a second drive far before the first one.
  EXPECT_EQ(read_table(rows_at({0, 1, 2, 0.5, 1.5, 2.5}), in_seconds)->size(), 2u);
  EXPECT_EQ(read_table(rows_at({500, 501, 502, 503, 504, 0, 1, 2, 3, 4}), in_seconds)->size(), 2u);
  // Late rows, a block that comes twice and rows in reverse are one mission.
  EXPECT_EQ(read_table(rows_at({0, 1, 2, 4, 3, 5, 6, 7, 8}), in_seconds)->size(), 1u);
  EXPECT_EQ(read_table(rows_at({0, 1, 2, 6, 7, 8, 3, 4, 5, 9, 10, 11}), in_seconds)->size(), 1u);
  EXPECT_EQ(read_table(rows_at({9, 8, 7, 6, 5, 4, 3, 2, 1}), in_seconds)->size(), 1u);
  const std::string block = "1,3,1,25\n2,4,1,25\n3,5,1,25\n4,6,1,25\n";
  const auto repeated = read_table("t,r,l,v\n0,2,1,25\n" + block + block + "5,7,1,25\n", in_seconds);
  ASSERT_EQ(repeated->size(), 1u);
  EXPECT_EQ((*repeated)[0].report.rows_out_of_time, 4u);
}

// A real-time clock without battery begins in 2000; the net sets it.
TEST(ImportTime, ClocksSetForwardBeginMission) {
  std::vector<double> times;
  for (int k = 0; k < 40; ++k) times.push_back((k < 10 ? 946'684'801 : 1'764'144'000) + 0.1 * k);
  const auto set = read_table(rows_at(times), in_seconds);
  ASSERT_TRUE(set) << describe(set.error());
  ASSERT_EQ(set->size(), 2u);
  EXPECT_EQ((*set)[0].report.rows, 10u);
  EXPECT_THAT((*set)[0].report.notes[0], HasSubstr("line 12: the time goes forward by 8"));
}

TEST(ImportTime, WrapsAreUndone) {
  const std::string of_day = R"("column": "t", "unit": "ms", "wraps_at": 86400000)";
  std::string csv = "t,r,l,v\n";
  for (int k = 0; k < 300; ++k) csv += std::to_string((86'390'000 + 100 * k) % 86'400'000) + ",1,1,25\n";
  const auto one = read_table(csv, of_day);
  ASSERT_EQ(one->size(), 1u);
  EXPECT_EQ((*one)[0].report.samples, 300u);
  EXPECT_EQ((*one)[0].recording.samples.back().utime_us - (*one)[0].recording.samples.front().utime_us,
            29'900'000);
  EXPECT_EQ(read_table(csv, R"("column": "t", "unit": "ms")")->size(), 2u);
}

TEST(ImportTime, ZoneResolvesRepeatedHour) {
  std::string csv = "t,r,l,v\n";
  for (const char* stamp : {"02:59:58", "02:59:59", "02:00:00", "02:00:01", "03:00:00"})
    csv += std::string("2025-10-26 ") + stamp + ",1,1,25\n";
  const auto berlin = read_table(csv, R"("column": "t", "unit": "iso8601", "utc_offset": "Europe/Berlin")");
  ASSERT_TRUE(berlin) << describe(berlin.error());
  ASSERT_EQ(berlin->size(), 1u);
  const auto& samples = (*berlin)[0].recording.samples;
  const std::int64_t first_us = 1'761'440'398'000'000;  // 2025-10-26 00:59:58 UTC
  std::vector<std::int64_t> seconds;
  for (const signals::Sample& sample : samples) seconds.push_back((sample.utime_us - first_us) / 1'000'000);
  EXPECT_THAT(seconds, ::testing::ElementsAre(0, 1, 2, 3, 3602));
  EXPECT_EQ(
      mapping_fault(
          R"({"robot_id": "r", "time": {"column": "t", "unit": "iso8601", "utc_offset": "Mars/Base"}, )" +
          wheels + "}}"),
      "/time/utc_offset");
}

TEST(ImportTime, UsualStampsAreRead) {
  const auto first_us = [](const std::string& stamp, const std::string& more = R"(, "utc_offset": "Z")") {
    const auto read =
        read_table("t;r;l;v\n" + stamp + ";1;1;25\n", R"("column": "t", "unit": "iso8601")" + more);
    return read ? (*read)[0].recording.samples[0].utime_us : std::int64_t{-1};
  };
  constexpr std::int64_t eight = 1'764'144'000'250'000;  // 2025-11-26 08:00:00.25 UTC
  for (const char* stamp : {"2025-11-26 08:00:00.250+00",
                            "2025-11-26 09:00:00.25+0100",
                            "2025-11-26T08:00:00.250000000Z",
                            "2025-11-26 08:00:00.25 UTC",
                            "2025/11/26 08:00:00,25",
                            "20251126T080000.25Z",
                            "20251126 080000.25",
                            "26.11.2025 08:00:00.25",
                            "26-Nov-2025 08:00:00.25",
                            "Wed, 26 Nov 2025 08:00:00.25 GMT",
                            "Nov 26, 2025 8:00:00.25 AM",
                            "26 Nov 2025 03:00:00.25 -0500",
                            "11/26/2025 08:00:00.25",
                            "26/11/2025 08:00:00.25",
                            "11/26/2025 8:00:00.25 AM",
                            "2025-11-26-08-00-00.25",
                            "2025_11_26_08_00_00_25",
                            "20251126080000.25",
                            "2025-11-26 08:00:00:250",
                            "2025/11/26-08:00:00.25",
                            "26-NOV-25 08.00.00.250 AM",
                            "08:00:00.25 26/11/2025",
                            "2025\u5e7411\u670826\u65e5 08:00:00.25",
                            "26/Nov/2025:08:00:00.25 +0000",
                            "Wed Nov 26 08:00:00.25 UTC 2025",
                            "2025-11-26 08:00:00.25 +0000 UTC",
                            "2025-11-26t08:00:00.25z",
                            "2025-11-26 09:00:00.25 CET",
                            "2025-11-26 03:00:00.25 America/New_York",
                            "2025-11-26T09:00:00.25+01:00[Europe/Berlin]"})
    EXPECT_EQ(first_us(stamp), eight) << stamp;
  EXPECT_EQ(first_us("26.11.25 08h", R"(, "utc_offset": "Z", "format": "%d.%m.%y %Hh")"), eight - 250'000);
  for (const char* stamp :
       {"05/06/2025 08:00:00", "31.02.2025 08:00:00", "2025-11-26", "26 Nov", "25:00:00",
        "2025-11-26 08:61:00", "26-11-25 08:00:00", "Nov 26 08:00:00", "2025-11-26 08:00 XYZ"})
    EXPECT_EQ(first_us(stamp), -1) << stamp;
  const auto doubt =
      read_table("t;r;l;v\n05/06/2025 08:00:00;1;1;2\n", R"("column": "t", "unit": "iso8601")");
  EXPECT_THAT(doubt.error().message, HasSubstr("\"format\" decides"));
  // Of two columns, and of seconds with nanoseconds.
  const auto joined = read_table("d;t;r;l;v\n2025-11-26;08:00:00.25;1;1;25\n",
                                 R"("columns": ["d", "t"], "unit": "iso8601", "utc_offset": "Z")");
  EXPECT_EQ((*joined)[0].recording.samples[0].utime_us, eight);
  const auto summed = read_table("s,n,r,l,v\n1764144000,250000000,1,1,25\n",
                                 R"("columns": ["s", {"column": "n", "scale": 1e-9}], "unit": "s")");
  EXPECT_EQ((*summed)[0].recording.samples[0].utime_us, eight);
}

// The clock of 01:30 comes twice; its abbreviation decides.
TEST(ImportTime, AbbreviationsResolveRepeatedHour) {
  const auto read = read_table("t,r,l,v\n2025-11-02 01:30:00 EST,1,1,25\n2025-11-02 01:30:01 EST,1,1,25\n",
                               R"("column": "t", "unit": "iso8601", "utc_offset": "America/New_York")");
  ASSERT_TRUE(read) << describe(read.error());
  EXPECT_EQ((*read)[0].recording.samples[0].utime_us, 1'762'065'000'000'000);  // 06:30 UTC
}

TEST(ImportTime, TimesOfDayPassMidnight) {
  for (const char* format : {"", R"(, "utc_offset": "Z", "format": "%H:%M:%S")"}) {
    const auto read = read_table(
        "t,r,l,v\n23:59:59.5,1,1,25\n00:00:00.5,1,1,25\n8:00:00.5,1,1,25\n16:00:00.5,1,1,25\n0:00:00.5,1,1,"
        "25\n",
        std::string(R"("column": "t", "unit": "iso8601")").append(format));
    ASSERT_TRUE(read) << describe(read.error());
    ASSERT_EQ(read->size(), 1u);
    const auto& samples = (*read)[0].recording.samples;
    EXPECT_EQ(samples[1].utime_us - samples[0].utime_us, 1'000'000);
    EXPECT_EQ(samples[4].utime_us - samples[1].utime_us, 86'400'000'000);
  }
}

TEST(ImportTime, HeavyLossIsRefused) {
  const auto whole = read_table("t,r,l,v\n5,1,1,25\n5,2,1,25\n5,3,1,25\n6,4,1,25\n", in_seconds);
  ASSERT_TRUE(whole);
  const auto lost = read_table("t,r,l,v\n5,1,1,25\n5,2,1,25\n5,3,1,25\n5,4,1,25\n6,4,1,25\n", in_seconds);
  ASSERT_FALSE(lost);
  EXPECT_THAT(lost.error().message,
              HasSubstr("3 of 5 rows of missions would be lost: 3 have the time of another row"));
  EXPECT_FALSE(read_table("t,r,l,v\n1,nan,1,2\n2,nan,1,2\n3,1,1,2\n", in_seconds));
}

TEST(ImportTime, FixedRateNeedsNoStamps) {
  const auto read = read_table("r,l,v\n1,1,25\n2,1,25\n3,1,25\n", R"("rate_hz": 20)");
  ASSERT_TRUE(read) << describe(read.error());
  EXPECT_EQ((*read)[0].recording.samples[2].utime_us, 100'000);
  const auto none = ImportMapping::parse(R"({"robot_id": "r", "time": {"unit": "s"}, )" + wheels + "}}");
  EXPECT_THAT(none.error().message, HasSubstr("rate_hz"));
}

TEST(ImportLayout, DamagedRowsAreLeftOut) {
  const std::string csv = "t,r,l,v\n0,1,1,25\n1,1,1,25\n";
  const auto rows_and_note = [&](const std::string& tail) {
    const auto read = read_table(csv + tail, in_seconds);
    if (!read) return describe(read.error());
    const ImportReport& report = (*read)[0].report;
    return std::to_string(report.samples) + (report.notes.empty() ? "" : ": " + report.notes[0]);
  };
  const std::string left_out =
      "2: damaged rows (truncated or with zero bytes) left out: 1, the first at line 4";
  const std::string zeros(9, '\0');
  for (const std::string& tail : {std::string("2,1"), std::string("2,1\n"), std::string("2,\"1"),
                                  std::string("2,1,1,2e"), zeros, "2,1" + zeros, zeros + "\n"})
    EXPECT_EQ(rows_and_note(tail), left_out) << tail;
  EXPECT_THAT(rows_and_note("2,1" + zeros + "1,1\n3,1,1,25\n"), HasSubstr("3: damaged rows"));
  EXPECT_EQ(rows_and_note("t,r,l,v\n2,1,1,25\n"), "3: repeated headers: 1");
  EXPECT_EQ(rows_and_note("2,1,1,25,,\n"), "3");
  EXPECT_THAT(rows_and_note("2,1\n3,1,1,25\n"),
              HasSubstr("x.csv: line 4: has 2 fields, the header 4. If its columns"));
  EXPECT_EQ(rows_and_note("2,1,1,x\n"),
            R"(x.csv: line 4: column 'v': 'x' is no number; "no_value" lists words for no value)");
}

TEST(ImportLayout, EncodingAndSeparatorAreDetected) {
  const auto voltages = [](const std::string& csv) {
    const auto read = read_table(csv, in_seconds);
    EXPECT_TRUE(read) << describe(read.error());
    std::string text;
    if (read)
      for (const signals::Sample& sample : (*read)[0].recording.samples)
        text += std::to_string(static_cast<int>(10 * sample.battery_voltage_v)) + " ";
    return text;
  };
  std::string wide = "\xFF\xFE", swapped, widest("\xFF\xFE\0\0", 4);
  for (const char c : std::string("t,r,l,v\n0,1,1,25.5\n1,1,1,26\n")) {
    wide += {c, '\0'};
    swapped += {'\0', c};
    widest += {c, '\0', '\0', '\0'};
  }
  for (const std::string& csv :
       {wide, swapped, widest, std::string("t;r;l;v\n0,0;1,5;1;25,5\n1,0;1,5;1;26\n"),
        std::string("sep=|\nt|r|l|v\n0|1|1|25.5\n1|1|1|26\n"),
        std::string("# t\tr\tl\tv\n0\t1\t1\t25.5\n1\t1\t1\t26\n"),
        std::string("t r  l v\n0 1 1  25.5\n 1 1 1 26\n"),
        std::string("t;r;l;v;Temp \xB0;\n0;1;1;25.5;3;\n1;1;1;26;3;\n")})
    EXPECT_EQ(voltages(csv), "255 260 ") << csv;
  EXPECT_THAT(read_table("a;b\n1;2\n", in_seconds).error().message,
              HasSubstr("column 't' is missing; the table has 'a', 'b'"));
}

TEST(ImportLayout, NumbersInManyForms) {
  const auto voltage = [](const std::string& cell) {
    const auto read = read_table("t;r;l;v\n0;1;1;" + cell + "\n1;1;1;" + cell + "\n", in_seconds);
    return read ? (*read)[0].recording.samples[0].battery_voltage_v : -1;
  };
  for (const char* cell : {"26371.5", "26,371.5", "26.371,5", "26'371.5", "26'371,5", "26\u00a0371.5",
                           "26\u202f371,5", "26371,5 mV", "26371.5mV", "+2.63715e4"})
    EXPECT_DOUBLE_EQ(voltage(cell), 26371.5) << cell;
  EXPECT_DOUBLE_EQ(voltage("1,234,567"), 1'234'567);
  EXPECT_DOUBLE_EQ(voltage("\u221226.5"), -26.5);
  for (const char* cell : {"1,23,456.5", "1234,567.5", "26.5.1", "2 6", "5 of 10"})
    EXPECT_EQ(voltage(cell), -1) << cell;
  const auto last_of = [](const std::string& table) {
    return (*read_table(table, in_seconds))[0].recording.samples[1];
  };
  for (const char* table :
       {"t,r,l,v\n0,834,1,\"26,372\"\n1,\"1,834\",1,\"26,372\"\n",
        "t;r;l;v\n0;834;1;26.372\n1;1.834;1;26.372\n", "t;r;l;v\n0;834;1;26,372\n1;1,834;1;26,372\n"}) {
    EXPECT_EQ(last_of(table).wheel_velocity_rad_s[0], 1834) << table;
    EXPECT_EQ(last_of(table).battery_voltage_v, 26372) << table;
  }
  EXPECT_EQ(last_of("t;r;l;v\n0;834;1;26,372\n1;0,834;1;26,372\n").battery_voltage_v, 26.372);
  const auto units = read_table("t,r,l,v\n0,1,1,26 V\n1,1,1,26 V\n2,1,1,26000 mV\n3,1,1,26 V\n", in_seconds);
  EXPECT_THAT(units.error().message, HasSubstr("has the unit 'mV', the rows before 'V'"));
}

TEST(ImportLayout, LinesBeforeHeaderAreLeftOut) {
  for (const char* before :
       {"# of logger 3\n# 2025-11-26\n", "Logger,3\nVersion,1.5\n\n", "drive of today\n"}) {
    const auto read =
        read_table(before + std::string("t,r,l,v\ns,rad/s,rad/s,V\n0,1,1,25\n1,1,1,25\n"), in_seconds);
    ASSERT_TRUE(read) << describe(read.error());
    EXPECT_EQ((*read)[0].report.samples, 2u);
    EXPECT_THAT((*read)[0].report.notes[0], HasSubstr("has no numbers, such as units"));
    EXPECT_THAT((*read)[0].report.notes[1], HasSubstr("lines before the header are left out"));
  }
}

TEST(ImportLayout, ShortHeadersAreExplained) {
  for (const auto& [csv, line, advice] :
       {std::tuple{"t,r,l,v\n0,1,1,25,0.5\n1,1,1,25,0.5\n", "line 2", R"(Name every column in "header")"},
        {"t;r;l;v\n0;1;1;25;0.5\n1;1;1;25;0.5\n", "line 2", R"(Name every column in "header")"},
        {"t,r,l,v\n0,1,1,25\n1,1,1,25,0.5\n2,1,1,25,0.5\n", "line 3", "split the table here"}}) {
    const auto read = read_table(csv, in_seconds);
    ASSERT_FALSE(read);
    EXPECT_THAT(read.error().field, HasSubstr(line)) << csv;
    EXPECT_THAT(read.error().message, HasSubstr("has 5 fields, the header 4"));
    EXPECT_THAT(read.error().message, HasSubstr(advice));
  }
  const auto named = read_table("t,r,l,v\n0,1,1,25,0.5\n1,1,1,26,0.5\n", in_seconds,
                                R"("skip_lines": 1, "header": ["t", "r", "l", "v", "a"], )");
  ASSERT_TRUE(named) << describe(named.error());
  EXPECT_EQ((*named)[0].recording.samples[1].battery_voltage_v, 26);
}

TEST(ImportTime, RowsOfUnsetClocksAreLeftOut) {
  const auto rows = [](const std::string& stamps) {
    std::string csv = "t,r,l,v\n";
    for (const char kind : stamps)
      csv += (kind == '0'   ? "3"
              : kind == '-' ? ""
              : kind == 'n' ? "nan"
                            : std::to_string(1'764'144'000 + csv.size())) +
             ",1,1,25\n";
    return read_table(csv, in_seconds);
  };
  for (const char* stamps : {"000ttttt", "--nttttt", "ttt0n-tt"}) {
    const auto read = rows(stamps);
    ASSERT_TRUE(read) << describe(read.error());
    ASSERT_EQ(read->size(), 1u);
    EXPECT_EQ((*read)[0].report.samples, 5u) << stamps;
    EXPECT_THAT((*read)[0].report.notes, ::testing::Not(::testing::IsEmpty()));
  }
  EXPECT_THAT(rows("00000tt").error().message, HasSubstr("5 of 7 rows are of a clock that is not set"));
  EXPECT_THAT(rows("nnnnntt").error().message, HasSubstr("'nan' is no time"));
  EXPECT_TRUE(rows("0")) << "seconds from zero";
}

TEST(ImportLayout, JoinedFilesKeepTheirMarks) {
  const std::string mark = "\xEF\xBB\xBF";
  const auto read = read_table(mark + "t,r,l,v\n0,1,1,25\n" + mark + "t,r,l,v\n1,1,1,25\n", in_seconds);
  ASSERT_TRUE(read) << describe(read.error());
  EXPECT_EQ((*read)[0].report.samples, 2u);
}

TEST(ImportLayout, EqualNamesNeedNumber) {
  const std::string csv = "t,r,l,v,t\n0,1,1,25,10\n1,1,1,25,11\n";
  EXPECT_THAT(read_table(csv, in_seconds).error().message,
              HasSubstr("columns 1 and 5 are both called 't': write 't#1' or 't#2' in the mapping"));
  const auto second = read_table(csv, R"("column": "t#2", "unit": "s")");
  EXPECT_EQ((*second)[0].recording.samples[0].utime_us, 10'000'000);
  EXPECT_THAT(read_table(csv, R"("column": "t#3", "unit": "s")").error().message,
              HasSubstr("'t#3' is missing"));
}

TEST(ImportLayout, WordsForNoValue) {
  const std::string csv = "t,r,l,v\n0,1,1,25\n1,1,1,NULL\n2,1,1,--.--\n3,1,1,#N/A\n4,1,1,-999\n5,1,1,\n";
  using ::testing::IsNan;
  EXPECT_THAT(battery_voltages(csv, R"("no_value": ["-999"], )", R"({"column": "v"})"),
              ::testing::ElementsAre(25, IsNan(), IsNan(), IsNan(), IsNan(), IsNan()));
  EXPECT_EQ(battery_voltages(csv, "", R"({"column": "v"})")[4], -999);
}

TEST(ImportLayout, ElementsOfLists) {
  const auto read = import_csv(
      "t,w\n0,\"[1.5, 2.5]\"\n1,\"array('d', [3, 4])\"\n2,(5;6)\n",
      *ImportMapping::parse(R"({"robot_id": "r", "mission_id": "m", "separator": ",", "time": {"column": "t",
      "unit": "s"}, "fields": {"wheel_velocity": [{"column": "w[1]"}, {"column": "w[0]"}]}})"));
  ASSERT_TRUE(read) << describe(read.error());
  ASSERT_EQ(read->recording.samples.size(), 3u);
  EXPECT_EQ(read->recording.samples[0].wheel_velocity_rad_s, (std::array<double, 2>{2.5, 1.5}));
  EXPECT_EQ(read->recording.samples[1].wheel_velocity_rad_s, (std::array<double, 2>{4, 3}));
  EXPECT_EQ(read->recording.samples[2].wheel_velocity_rad_s, (std::array<double, 2>{6, 5}));
  const auto columns = [](const std::string& right, const std::string& left) {
    const std::string csv = "t,w\n0,\"{'r': 4, 'l': 3}\"\n1,\"{'r': 4, 'l': 3}\"\n";
    return import_csv(csv, *ImportMapping::parse(
                               R"({"robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "s"},
        "fields": {"wheel_velocity": [{"column": ")" +
                               right + R"("}, {"column": ")" + left + R"("}]}})"));
  };
  EXPECT_EQ(columns("w[1]", "w[3]")->recording.samples[1].wheel_velocity_rad_s,
            (std::array<double, 2>{4, 3}));
  EXPECT_THAT(columns("w[1]", "w[4]").error().message, HasSubstr("; no number in 'w[4]'"));
}

// A log of changes holds for 2 s, then a value changes: the integral of the steps, straight from sample to
// sample.
TEST(ImportSamples, ChangesHoldBetweenRows) {
  const std::string csv = "t,r,l,v\n0,0,0,20\n0.1,1,1,\n2.1,,,30\n2.2,2,2,\n2.3,,1,\n";
  const auto held = read_table(csv, in_seconds, R"("rows": "on_change", )");
  const auto& samples = (*held)[0].recording.samples;
  double volt_seconds = 0;
  for (std::size_t k = 1; k < samples.size(); ++k) {
    const double dt_s = 1e-6 * static_cast<double>(samples[k].utime_us - samples[k - 1].utime_us);
    EXPECT_LE(dt_s, 1);
    EXPECT_EQ(samples[k].sequence, static_cast<std::int64_t>(k));
    volt_seconds += dt_s * (samples[k].battery_voltage_v + samples[k - 1].battery_voltage_v) / 2;
  }
  EXPECT_NEAR(volt_seconds, 2 * 20 + 0.1 * 25 + 0.2 * 30, 1e-9);
  EXPECT_THAT((*read_table(csv, in_seconds))[0].report.notes,
              ::testing::ElementsAre(HasSubstr("\"rows\": \"on_change\"")));
}

TEST(ImportSamples, WrappedSpeedsAreUndone) {
  std::string csv = "t,r,l\n";
  for (int k = 0; k < 100; ++k) {
    const int counts = static_cast<int>(40'000 * std::sin(0.1 * k));  // of a counter from -32768 to 32767
    csv += std::to_string(0.1 * k) + "," + std::to_string((counts + 98'304) % 65'536 - 32'768) + ",1\n";
  }
  const auto with = [&](const std::string& wraps) {
    return missions_of(csv, R"({"robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "s"},
      "fields": {"wheel_velocity": [{"column": "r", "divide_by": 1000)" +
                                wraps + R"(}, {"column": "l"}]}})");
  };
  EXPECT_THAT(with("")[0].report.notes,
              ::testing::ElementsAre(HasSubstr("\"wraps_at\": 65536 corrects a counter that overflows")));
  const auto read = with(R"(, "wraps_at": 65536)");
  for (int k = 0; k < 100; ++k)
    EXPECT_NEAR(read[0].recording.samples[static_cast<std::size_t>(k)].wheel_velocity_rad_s[0],
                40 * std::sin(0.1 * k), 1e-3);
}

// Positions of an encoder in whole counts that jump by 7, stay there and jump back; the wheel starts and
// stops sharply.
TEST(ImportSamples, ThrownPositionsAreTakenOut) {
  std::string smooth = "t,r,l,v\n", thrown = smooth;
  double turned = 0;
  for (int k = 0; k < 400; ++k) {
    turned += k > 50 && k < 300 ? 1.3 + 0.4 * std::sin(0.05 * k) : 0;
    const double counts = std::floor(turned);
    smooth += std::to_string(0.1 * k) + "," + std::to_string(counts) + ",1,25\n";
    const double jump = (k >= 120 && k < 123) || k >= 200 ? 40 : 0;
    thrown += std::to_string(0.1 * k) + "," + std::to_string(counts + jump) + ",1,25\n";
  }
  const auto speeds = [](const std::string& csv) {
    auto read = import_csv(
        csv,
        *ImportMapping::parse(R"({"robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "s"},
      "fields": {"wheel_velocity": [{"column": "r", "rate": {"window_s": 0.4}}, {"column": "l"}]}})"));
    EXPECT_TRUE(read);
    return std::move(*read);
  };
  const Import clean = speeds(smooth), mended = speeds(thrown);
  EXPECT_TRUE(clean.report.glitches.empty());
  EXPECT_EQ(mended.report.glitches.size(), 3u);
  for (std::size_t k = 0; k < 400; ++k)
    EXPECT_NEAR(mended.recording.samples[k].wheel_velocity_rad_s[0],
                clean.recording.samples[k].wheel_velocity_rad_s[0], 6)
        << k;
}

TEST(ImportSamples, TurnsOfWheelsAreUndone) {
  for (const double from : {0.0, -std::numbers::pi}) {
    std::string csv = "t,r,l,v\n";
    for (int k = 0; k < 60; ++k) {
      const double angle = std::remainder(0.9 * k, 2 * std::numbers::pi) - std::numbers::pi - from;
      csv += std::to_string(0.1 * k) + "," + std::to_string(angle) + "," + std::to_string(0.01 * k) + ",25\n";
    }
    const auto mapping = ImportMapping::parse(
        R"({"robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "s"}, "fields": {"wheel_velocity": [
           {"column": "r", "rate": {}}, {"column": "l", "rate": {}}]}})");
    const auto read = import_csv(csv, *mapping, {});
    ASSERT_TRUE(read) << describe(read.error());
    for (const signals::Sample& sample : read->recording.samples) {
      EXPECT_NEAR(sample.wheel_velocity_rad_s[0], 9, 1e-3);
      EXPECT_NEAR(sample.wheel_velocity_rad_s[1], 0.1, 1e-3);
    }
    EXPECT_THAT(
        read->report.notes,
        ::testing::ElementsAre(::testing::HasSubstr("wheel_velocity[0]: positions jump back by a turn")));
  }
}

TEST(ImportSamples, OtherPeriodsAreNotTurns) {
  for (const double period : {3.6, 4.2, 5.5, 7.0}) {
    std::string csv = "t,r,l\n";
    for (int k = 0; k < 60; ++k)
      csv += std::to_string(0.1 * k) + "," + std::to_string(std::fmod(0.7 * k, period)) + "," +
             std::to_string(k) + "\n";
    const auto read =
        missions_of(csv, R"({"robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "s"},
      "fields": {"wheel_velocity": [{"column": "r", "rate": {}}, {"column": "l"}]}})");
    EXPECT_THAT(read[0].report.notes,
                ::testing::Contains(HasSubstr(fmt::format("positions jump by {}", period))));
  }
}

TEST(ImportSamples, CountersOfTwelveBitsAreNoted) {
  std::string csv = "t,r,l\n";
  for (int k = 0; k < 60; ++k)
    csv += std::to_string(0.1 * k) + "," + std::to_string(500 * k % 4096) + "," + std::to_string(k) + "\n";
  const auto with = [&](const std::string& wraps) {
    return missions_of(csv, R"({"robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "s"},
      "fields": {"wheel_velocity": [{"column": "r", "divide_by": 100, "rate": {})" +
                                wraps + R"(}, {"column": "l"}]}})");
  };
  EXPECT_THAT(with("")[0].report.notes, ::testing::Contains(HasSubstr("\"wraps_at\" corrects a counter")));
  const auto corrected = with(R"(, "wraps_at": 4096)");
  for (const signals::Sample& sample : corrected[0].recording.samples)
    EXPECT_NEAR(sample.wheel_velocity_rad_s[0], 50, 1e-6);
}

TEST(ImportMapping, ReportsEveryFaultAndWarning) {
  const auto faulty =
      ImportMapping::parse(mapping_text(R"("robt_id": 1, "payload_kg": -1, "separator": ",,", )"));
  ASSERT_FALSE(faulty);
  const std::string all = faulty.error().field + " " + faulty.error().message;
  for (const char* pointer : {"/robt_id", "/payload_kg", "/separator"}) EXPECT_THAT(all, HasSubstr(pointer));
  const auto warned = [](const std::string& fields) {
    std::vector<std::string> pointers;
    for (const FieldFault& warning : suspicious(mapping_of("", fields))) pointers.push_back(warning.field);
    return pointers;
  };
  EXPECT_THAT(warned(R"(, "battery_voltage": {"column": "v"}, "battery_current": {"column": "i"})"),
              ::testing::IsEmpty());
  EXPECT_THAT(warned(""), ::testing::ElementsAre("/fields"));
  EXPECT_THAT(warned(R"(, "battery_voltage": {"constant": 24}, "battery_current": {"column": "i"})"),
              ::testing::ElementsAre("/fields/battery_voltage"));
}

TEST(ImportMapping, WarnsOfUnitsInHeaders) {
  const auto warned = [](const std::string& column, const std::string& more = "") {
    return suspicious(
               mapping_of(
                   "",
                   ", \"battery_voltage\": {\"column\": \"U [V]\"}, \"battery_current\": {\"column\": \"" +
                       column + "\"" + more + "}"))
        .size();
  };
  for (const char* own : {"I [A]", "I (a)", "I (battery)", "[x] I"}) EXPECT_EQ(warned(own), 0u) << own;
  EXPECT_EQ(warned("I [mA]", ", \"scale\": 0.001"), 0u);
  for (const char* other : {"I [mA]", "I (mA)", "I [km/h]", "I [%]"}) EXPECT_EQ(warned(other), 1u) << other;
  EXPECT_EQ(warned("I [mA]", ", \"negate\": true"), 1u);
}

TEST(ImportMapping, FaultsNameMember) {
  EXPECT_EQ(mapping_fault("{"), "");
  EXPECT_EQ(mapping_fault(mapping_text(R"("robt_id": 1, )")), "/robt_id");
  EXPECT_EQ(mapping_fault(mapping_text(R"("payload_kg": -1, )")), "/payload_kg");
  EXPECT_EQ(mapping_fault(mapping_text(R"("separator": ",,", )")), "/separator");
  EXPECT_EQ(mapping_fault(mapping_text(R"("empty_cells": "guess", )")), "/empty_cells");
  EXPECT_EQ(mapping_fault(mapping_text(R"("tables": {"b": {"file": "b.csv"}}, )")), "/tables/b/time");
  EXPECT_EQ(
      mapping_fault(mapping_text("", R"(, "yaw_rate": {"column": "h", "sign_from": ["r"], "rate": {}})")),
      "/fields/yaw_rate/rate");
  EXPECT_EQ(mapping_fault(mapping_text(R"("require": [], )")), "/require");
  EXPECT_EQ(
      mapping_fault(mapping_text(R"("column_limits": {"r": {"low": 2, "high": 1, "outside": "hold"}}, )")),
      "/column_limits/r");
  EXPECT_EQ(mapping_fault(mapping_text(R"("column_limits": {"r": {"low": 2}}, )")),
            "/column_limits/r/outside");
  EXPECT_EQ(mapping_fault(mapping_text(R"("covariates": [], )")), "/covariates");
  EXPECT_EQ(mapping_fault(mapping_text(R"("covariates": {"a b": {"constant": 1}}, )")), "/covariates/a b");
  EXPECT_EQ(mapping_fault(mapping_text(R"("covariates": {"a=b": {"constant": 1}}, )")), "/covariates/a=b");
  EXPECT_EQ(mapping_fault(mapping_text(R"("covariates": {"a": {}}, )")), "/covariates/a");
  std::string many;
  for (int k = 0; k < 65; ++k)
    many += (k > 0 ? ", \"c" : "\"c") + std::to_string(k) + R"(": {"constant": 1})";
  EXPECT_EQ(mapping_fault(mapping_text("\"covariates\": {" + many + "}, ")), "/covariates");
  EXPECT_EQ(mapping_fault(mapping_text("", R"(, "speed": {"column": "r"})")), "/fields/speed");
  EXPECT_EQ(mapping_fault(mapping_text("", R"(, "pose": [null])")), "/fields/pose");
  EXPECT_EQ(mapping_fault(mapping_text("", R"(, "pitch": {})")), "/fields/pitch");
  EXPECT_EQ(mapping_fault(mapping_text("", R"(, "pitch": {"column": "a", "constant": 1})")), "/fields/pitch");
  EXPECT_EQ(mapping_fault(mapping_text("", R"(, "pitch": {"column": "a", "divide_by": 0})")),
            "/fields/pitch/divide_by");
  EXPECT_EQ(mapping_fault(mapping_text("", R"(, "pitch": {"column": "a", "abs": true})")),
            "/fields/pitch/abs");
  EXPECT_EQ(mapping_fault(mapping_text("", R"(, "pose": [null, null, {"quaternion_yaw": ["x"]}])")),
            "/fields/pose/2/quaternion_yaw");
  EXPECT_EQ(mapping_fault(R"({"robot_id": "a b", "time": {"column": "t", "unit": "s"}, "fields": {}})"),
            "/robot_id");
  EXPECT_EQ(mapping_fault(R"({"robot_id": "a", "time": {"column": "t", "unit": "h"}, "fields": {}})"),
            "/time/unit");
  EXPECT_EQ(mapping_fault(R"({"robot_id": "a", "time": {"column": "t", "unit": "s"}, "fields": {}})"),
            "/fields/wheel_velocity");
}

TEST(ImportMapping, RejectsLimitsOfUnusedColumn) {
  const ImportMapping mapping = mapping_of(R"("column_limits": {"v": {"low": 0, "outside": "hold"}}, )");
  EXPECT_EQ(import_csv("t,r,l,v\n0,1,1,1\n", mapping).error().field, "/column_limits/v");
}

}  // namespace
}  // namespace joulecast::telemetry
