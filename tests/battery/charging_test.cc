#include "battery/charging.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "battery/circuit.h"

namespace joulecast::battery {
namespace {

robot::Battery pack() {
  robot::Battery b;
  b.nominal_voltage_v = 25.6;
  b.capacity_ah = 20;
  b.internal_resistance_ohm = 0.05;
  b.open_circuit_voltage = {{0, 21.5}, {0.15, 24.7}, {0.8, 26.4}, {0.95, 26.9}, {1, 27.6}};
  return b;
}

// A charger with an observer at the battery: 10 A, then 27.6 V, until 0.8 A.
class Station {
 public:
  explicit Station(double charge) : circuit_(pack()), state_(Circuit::rested(charge)), observer_(20) {}

  // One second; returns the current into the battery.
  double charge() {
    const double open = circuit_.open_circuit_voltage_v(state_.charge);
    const double into_a = std::min(10.0, (27.6 - open) / 0.05);
    state_ = circuit_.advanced(state_, -into_a, 1, 25);
    observe(-into_a, false);
    return into_a;
  }
  void drive(double current_a) {
    state_ = circuit_.advanced(state_, current_a, 1, 25);
    observe(current_a, true);
  }
  void stand(double current_a) {
    state_ = circuit_.advanced(state_, current_a, 1, 25);
    observe(current_a, false);
  }

  ChargingObserver& observer() { return observer_; }
  double state_of_charge() const { return state_.charge; }
  double clock_s() const { return 1e-6 * static_cast<double>(now_us_); }

 private:
  void observe(double current_a, bool moving) {
    now_us_ += 1'000'000;
    observer_.add({now_us_, circuit_.voltage_v(state_, current_a), current_a, moving, state_.charge});
  }

  Circuit circuit_;
  State state_;
  ChargingObserver observer_;
  std::int64_t now_us_ = 1'000'000'000;
};

// Charges to the end and returns the duration.
double charge_up(Station& station) {
  const double began = station.clock_s();
  while (station.charge() > 0.8) {
  }
  const double took = station.clock_s() - began;
  for (int k = 0; k < 10; ++k) station.stand(0);
  return took;
}

TEST(Charging, DiffersFromRegeneration) {
  Station station(0.5);
  for (int k = 0; k < 60; ++k) {
    station.drive(k % 3 == 0 ? -12 : 8);
    EXPECT_FALSE(station.observer().charging());
  }
  // The last second of braking ends at rest: too short for a charger.
  station.stand(-6);
  station.stand(1);
  EXPECT_EQ(station.observer().phase(), ChargingPhase::none);
  EXPECT_FALSE(station.observer().take_ended());
}

TEST(Charging, AccountsForAStay) {
  Station station(0.3);
  const double start = station.state_of_charge();
  charge_up(station);
  EXPECT_EQ(station.observer().phase(), ChargingPhase::full);
  const auto stay = station.observer().take_ended();
  ASSERT_TRUE(stay);
  EXPECT_TRUE(stay->complete);
  // Everything but the first second, between the last reading before and the first of the charger.
  EXPECT_NEAR(stay->charged_ah, 20 * (station.state_of_charge() - start), 1.1 * 10 / 3600);
  EXPECT_GT(stay->charged_j, stay->charged_ah * 3600 * 25);
  EXPECT_LT(stay->charged_j, stay->charged_ah * 3600 * 27.6);
  station.drive(5);
  EXPECT_EQ(station.observer().phase(), ChargingPhase::none);
}

TEST(Charging, EarlyUnplugIsIncomplete) {
  Station station(0.3);
  for (int k = 0; k < 600; ++k) station.charge();
  EXPECT_EQ(station.observer().phase(), ChargingPhase::constant_current);
  station.drive(4);
  const auto stay = station.observer().take_ended();
  ASSERT_TRUE(stay);
  EXPECT_FALSE(stay->complete);
  EXPECT_EQ(station.observer().phase(), ChargingPhase::none);
}

TEST(Charging, LearnsTheTaper) {
  // Before any stay: the usual course, with a deviation that covers the truth.
  Station first(0.3);
  for (int k = 0; k < 120; ++k) first.charge();
  const ChargingTime guess = first.observer().remaining(first.state_of_charge(), 0.01);
  const double rest = charge_up(first);
  EXPECT_LT(std::fabs(guess.duration_s - rest), 2 * guess.sd_s);
  const ChargingHabit& habit = first.observer().habit();
  EXPECT_NEAR(habit.current_a.mean, 10, 0.05);
  EXPECT_NEAR(habit.end_current_a.mean, 0.8, 0.1);
  // tau = R C / U'(s) at the top: 0.05 ohm * 72000 As / 14 V.
  EXPECT_NEAR(habit.taper_time_s.mean, 0.05 * 72000 / 14, 30);

  // After one stay: from any charge to the end within a twentieth, and within the stated deviation.
  for (const double from : {0.2, 0.6, 0.9}) {
    Station later(from);
    later.observer().recall(habit);
    for (int k = 0; k < 60; ++k) later.charge();
    const double charge = later.state_of_charge();
    const ChargingTime known = later.observer().remaining(charge, 0.01);
    const ChargingTime planned = time_to_full(habit, 20, charge, 0.01);
    const double began = later.clock_s();
    while (later.charge() > 0.8) continue;
    const double truth = later.clock_s() - began;
    EXPECT_NEAR(known.duration_s, truth, std::max(0.05 * truth, 60.0)) << from;
    EXPECT_LT(std::fabs(known.duration_s - truth), 2 * known.sd_s) << from;
    EXPECT_NEAR(planned.duration_s, truth, std::max(0.05 * truth, 60.0)) << from;
    EXPECT_GT(known.sd_s, 0);
  }
}

TEST(Charging, TimeIsUnknownWithoutCurrent) {
  EXPECT_TRUE(std::isnan(time_to_full({}, 20, 0.5, 0.01).duration_s));
  EXPECT_TRUE(std::isnan(ChargingObserver(20).remaining(0.5, 0.01).duration_s));
}

}  // namespace
}  // namespace joulecast::battery
