#include "signals/sample.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <set>
#include <string>

namespace joulecast::signals {
namespace {

TEST(Sample, EveryNumberIsVisitedOnce) {
  Sample sample;
  const auto numbers = numbers_of(sample);
  EXPECT_EQ(std::set<double*>(numbers.begin(), numbers.end()).size(), sample_numbers);
  for (double* number : numbers) *number = 1;
  // Everything except the clock and the sequence has changed.
  static_assert(sizeof(Sample) == 2 * sizeof(std::int64_t) + sample_numbers * sizeof(double));
  std::array<double, sizeof(Sample) / sizeof(double)> words{};
  std::memcpy(words.data(), &sample, sizeof(Sample));
  EXPECT_EQ(std::ranges::count(words, 1.0), static_cast<std::ptrdiff_t>(sample_numbers));
}

TEST(Sample, NumbersHaveDistinctNames) {
  std::set<std::string> names, keys;
  for (const SampleField& field : sample_fields) {
    EXPECT_TRUE(names.insert(std::string(field.name) + "." + std::string(field.part)).second) << field.name;
    const bool side = field.part == "right" || field.part == "left";
    EXPECT_TRUE(keys.insert(std::string(field.key) + (side ? std::string(field.part) : "")).second)
        << field.key;
  }
}

}  // namespace
}  // namespace joulecast::signals
