#include "signals/gaps.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <random>

namespace joulecast::signals {
namespace {

// Instants [s] of samples numbered from 0 on.
std::vector<Sample> stream(const std::vector<double>& times_s) {
  std::vector<Sample> samples(times_s.size());
  for (std::size_t k = 0; k < samples.size(); ++k) {
    samples[k].utime_us = std::llround(1e6 * times_s[k]);
    samples[k].sequence = static_cast<std::int64_t>(k);
  }
  return samples;
}

std::vector<Sample> regular(double rate_hz, std::size_t count) {
  std::vector<double> times_s(count);
  for (std::size_t k = 0; k < count; ++k) times_s[k] = static_cast<double>(k) / rate_hz;
  return stream(times_s);
}

void delay(std::vector<Sample>& samples, std::size_t from, double pause_s) {
  for (std::size_t k = from; k < samples.size(); ++k) samples[k].utime_us += std::llround(1e6 * pause_s);
}

// Indices of the samples behind a gap.
std::vector<std::size_t> gaps_in(const std::vector<Sample>& samples, double bound_s = usual_bound_s) {
  const std::vector<Step> steps = steps_of(samples, bound_s);
  std::vector<std::size_t> gaps;
  for (std::size_t k = 0; k < steps.size(); ++k)
    if (steps[k] == Step::gap) gaps.push_back(k);
  return gaps;
}

using Indices = std::vector<std::size_t>;

TEST(Gaps, BridgesRegularStreams) {
  for (const double rate_hz : {0.1, 0.6, 1.0, 5.0, 50.0, 500.0}) {
    EXPECT_EQ(gaps_in(regular(rate_hz, 100)), Indices{}) << rate_hz;
    EXPECT_EQ(gaps_in(regular(rate_hz, 2)), Indices{}) << rate_hz;
  }
  EXPECT_EQ(steps_of(regular(1, 3)), (std::vector{Step::first, Step::bridged, Step::bridged}));
}

TEST(Gaps, BridgesIrregularStreams) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> shake(-0.02, 0.02);
  std::uniform_real_distribution<double> exponent(-0.5, 0.5);  // 0.3 s to 3 s
  std::vector<double> shaken, irregular;
  for (int k = 0; k < 1000; ++k) {
    shaken.push_back(k + shake(random));
    irregular.push_back((irregular.empty() ? 0.0 : irregular.back()) + std::pow(10.0, exponent(random)));
  }
  EXPECT_EQ(gaps_in(stream(shaken)), Indices{});
  EXPECT_EQ(gaps_in(stream(irregular)), Indices{});
}

TEST(Gaps, FindsPausesInFastStreams) {
  for (const double rate_hz : {10.0, 50.0, 500.0}) {
    for (const std::size_t at : {1u, 2u, 50u, 97u, 99u}) {
      std::vector<Sample> samples = regular(rate_hz, 100);
      delay(samples, at, 3);
      EXPECT_EQ(gaps_in(samples), Indices{at}) << rate_hz;
    }
  }
  std::vector<Sample> twice = regular(50, 100);
  delay(twice, 50, 3);
  delay(twice, 53, 3);
  for (std::size_t k = 50; k < 100; ++k) twice[k].sequence += k < 53 ? 150 : 300;
  EXPECT_EQ(gaps_in(twice), (Indices{50, 53}));
}

TEST(Gaps, FindsLostSamplesByDuration) {
  std::vector<Sample> samples = regular(50, 1000);
  std::erase_if(samples, [](const Sample& s) { return s.sequence > 300 && s.sequence < 350; });  // 1 s
  std::erase_if(samples, [](const Sample& s) { return s.sequence > 600 && s.sequence < 651; });
  EXPECT_EQ(gaps_in(samples), Indices{601 - 49});
  std::vector<Sample> slow = regular(1, 100);
  std::erase_if(slow, [](const Sample& s) { return s.sequence > 20 && s.sequence < 30; });  // 10 s
  std::erase_if(slow, [](const Sample& s) { return s.sequence > 60 && s.sequence < 71; });
  EXPECT_EQ(gaps_in(slow), Indices{61 - 9});
}

TEST(Gaps, IndependentLossesAreNoGaps) {
  std::mt19937 random(5);
  for (const double rate_hz : {0.3, 1.0, 4.0, 50.0}) {
    std::vector<Sample> samples = regular(rate_hz, 2000);
    std::erase_if(samples, [&](const Sample&) { return random() % 10 < 3; });
    EXPECT_EQ(gaps_in(samples, 3600), Indices{}) << rate_hz;
  }
}

TEST(Gaps, FollowsChangesOfRate) {
  std::vector<double> times_s{0};
  for (const double rate_hz : {50.0, 5.0, 1.0, 0.1, 500.0, 0.2, 50.0})
    for (int k = 0; k < 30; ++k) times_s.push_back(times_s.back() + 1 / rate_hz);
  EXPECT_EQ(gaps_in(stream(times_s)), Indices{});
}

TEST(Gaps, KeepsPairsAndThinnedLogs) {
  std::vector<double> pairs;  // an import adds rows just before a held reading changes
  for (int k = 0; k < 50; ++k) {
    pairs.push_back(2.0 * k);
    pairs.push_back(2.0 * k + 1.998);
  }
  EXPECT_EQ(gaps_in(stream(pairs)), Indices{});
  std::vector<Sample> thinned = regular(1, 50);
  for (Sample& s : thinned) s.sequence *= 50;
  thinned.back().utime_us += 12'000'000;
  EXPECT_EQ(gaps_in(thinned), Indices{49});
}

TEST(Gaps, NothingExceedsTheBound) {
  EXPECT_EQ(gaps_in(regular(0.1, 4), 9), (Indices{1, 2, 3}));
  EXPECT_EQ(gaps_in(regular(2, 4), 0.4), (Indices{1, 2, 3}));
  EXPECT_EQ(longest_bridged_s(0.02), always_bridged_s);
  EXPECT_EQ(longest_bridged_s(0.5), 5);
  EXPECT_EQ(longest_bridged_s(10), usual_bound_s);
}

// For any stream: at most three samples wait, and a detector that starts with the samples on which a decision
// depends decides like one that has seen all.
TEST(GapDetector, KeepsBoundedHistory) {
  rc::check([] {
    std::vector<double> times_s{0};
    const auto count = *rc::gen::inRange<std::size_t>(2, 120);
    while (times_s.size() < count)
      times_s.push_back(times_s.back() + std::pow(10.0, *rc::gen::inRange(-3, 2)) * *rc::gen::inRange(1, 10));
    std::vector<Sample> samples = stream(times_s);
    for (std::size_t k = 1; k < count; ++k)
      samples[k].sequence = samples[k - 1].sequence + *rc::gen::inRange(1, 4);
    const std::vector<Step> whole = steps_of(samples);
    GapDetector detector;
    std::size_t decided = 0;
    for (std::size_t k = 0; k < count; ++k) {
      detector.add(samples[k].utime_us, samples[k].sequence);
      while (const auto next = detector.next()) RC_ASSERT(next->step == whole[decided++]);
      RC_ASSERT(k + 1 - decided <= steps_after);
    }
    while (const auto next = detector.next(true)) RC_ASSERT(next->step == whole[decided++]);
    RC_ASSERT(decided == count);
    const auto from = *rc::gen::inRange<std::size_t>(0, count);
    const std::vector<Step> part = steps_of(std::span(samples).subspan(from));
    for (std::size_t k = from == 0 ? 0 : steps_before + 1; k < part.size(); ++k)
      RC_ASSERT(part[k] == whole[from + k]);
  });
}

}  // namespace
}  // namespace joulecast::signals
