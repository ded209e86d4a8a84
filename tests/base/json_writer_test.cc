#include "base/json_writer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <vector>

#include "base/json_number.h"

namespace joulecast {
namespace {

std::string column_of(const std::vector<double>& numbers, int places) {
  JsonWriter json;
  json.begin_object().column("c", numbers, places).end_object();
  return json.take();
}

TEST(JsonColumn, WritesRoundedNumbers) {
  EXPECT_EQ(column_of({0, -0.0, 1e-7, -1e-7, 1e-6, -1e-6, 0.5, 12.25, -3, 9.9999999, 100, 0.000120}, 6),
            R"({"c":[0,0,0,0,0.000001,-0.000001,0.5,12.25,-3,10,100,0.00012]})");
  EXPECT_EQ(column_of({1.5, 2.5, -17}, 0), R"({"c":[2,2,-17]})");
  EXPECT_EQ(column_of({}, 3), R"({"c":[]})");
  EXPECT_EQ(column_of({NAN, INFINITY, 1.25}, 3), R"({"c":[null,null,1.25]})");
}

TEST(JsonColumn, ReadsBackWithinRounding) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> exponent(-9, 20);
  std::vector<double> numbers;
  for (int k = 0; k < 10'000; ++k) numbers.push_back((k % 2 ? 1 : -1) * std::pow(10, exponent(random)));
  numbers.push_back(std::numeric_limits<double>::max());
  numbers.push_back(-std::numeric_limits<double>::max());
  for (const int places : {0, 3, 6, 12}) {
    const auto read = nlohmann::json::parse(column_of(numbers, places)).at("c");
    ASSERT_EQ(read.size(), numbers.size());
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      // Half a unit of the last digit, and the resolution of doubles of that size.
      const double tolerance = 0.5 * std::pow(10, -places) + 4e-16 * std::fabs(numbers[k]);
      EXPECT_NEAR(read[k].get<double>(), numbers[k], tolerance) << places;
    }
  }
}

TEST(JsonWriter, RoundsBelowTheResolution) {
  JsonWriter json;
  json.begin_array().value(1.2e-223).value(-9.9e-19).value(1e-18).value(-1e-17).exact(1.2e-223).end_array();
  EXPECT_EQ(json.text(), "[0,0,1e-18,-1e-17,1.2e-223]");
  EXPECT_EQ(json_number(1.2e-223).dump(), "0.0");
}

TEST(JsonWriter, CompactsDocumentsButNotTexts) {
  JsonWriter json;
  json.begin_object()
      .key("model")
      .compact("{\n  \"a b\": [1,\t2],\r\n  \"c\\\" \\\\\": \" d \"\n}")
      .end_object();
  EXPECT_EQ(json.text(), R"({"model":{"a b":[1,2],"c\" \\":" d "}})");
}

}  // namespace
}  // namespace joulecast
