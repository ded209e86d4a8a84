#include "gap/posterior/terms.h"

#include <gtest/gtest.h>

#include <cmath>

#include "gap/posterior/hold_out.h"
#include "tests/gap/posterior/made_robot.h"

namespace joulecast::gap::posterior {
namespace {

using made::Drives;

std::unique_ptr<Fit> fit_of(const Drives& drives) {
  const telemetry::RecordingSet recordings = drives.recordings();
  return walk(*make_data(recordings.missions, drives.robot));
}

PowerTerms terms_of(const Fit& fit) {
  return power_terms(fit, predicted_power(fit.data, fit.data.in_file));
}

const Term* find(const PowerTerms& terms, std::string_view name) {
  const auto at = std::ranges::find(terms.terms, name, &Term::name);
  return at == terms.terms.end() ? nullptr : &*at;
}

TEST(PowerTerms, ConstantLoadIsIdlePower) {
  Drives drives(11);
  drives.load_w = [](double) { return 9.0; };
  const std::unique_ptr<Fit> fit = fit_of(drives);
  const PowerTerms terms = terms_of(*fit);
  const Term* constant = find(terms, "constant");
  ASSERT_NE(constant, nullptr);
  EXPECT_EQ(constant->unit, "W");
  EXPECT_LT(constant->deviation_w, 1);
  EXPECT_NEAR(constant->difference_w, 9, 3 * constant->deviation_w + 0.1);
  EXPECT_EQ(constant->explained, constant->model);
  ASSERT_EQ(terms.sums.size(), 1u);
  const TermSum& sum = terms.sums[0];
  EXPECT_EQ(sum.terms, "constant");
  EXPECT_NE(std::ranges::find(sum.effects, "accessory_load"), sum.effects.end());
  EXPECT_EQ(sum.parameter, "idle_power_w");
  EXPECT_NEAR(sum.value, drives.robot.idle_power_w + 9, 3 * sum.deviation + 0.1);
  EXPECT_NEAR(sum.deviation / constant->deviation_w, 1, 1e-3);
}

// The terms of the readings minus those of the model equal those of a planted function of motion.
TEST(PowerTerms, DifferencesMatchPlantedCoefficients) {
  Drives drives(12);
  const double radius_m = drives.robot.kinematics.wheel_radius_m;
  drives.load_w = [=](double t) {
    return 40 * radius_m / 2 * std::fabs(Drives::speed(t, 0) - Drives::speed(t, 1));
  };
  const PowerTerms terms = terms_of(*fit_of(drives));
  const Term* turning = find(terms, "turning");
  ASSERT_NE(turning, nullptr);
  EXPECT_LT(turning->deviation, 4);
  EXPECT_NEAR(turning->value - turning->model, 40, 3 * turning->deviation);
}

TEST(PowerTerms, SoundRobotHasNoSum) {
  const PowerTerms terms = terms_of(*fit_of(Drives(13)));
  EXPECT_FALSE(terms.terms.empty());
  EXPECT_TRUE(terms.sums.empty());
}

// The explanation is exact. Its error equals that of the noise, sqrt(2/pi) sd over the power.
TEST(HoldOut, LoneEffectExplainsItsGap) {
  Drives drives(14);
  drives.load_w = [](double) { return 9.0; };
  const std::unique_ptr<Fit> fit = fit_of(drives);
  const auto alone = std::ranges::find_if(fit->models, [&](const Model& m) {
    return !m.configuration && m.set.size() == 1 &&
           fit->catalogue.hypotheses[m.set[0]].id() == "accessory_load";
  });
  ASSERT_NE(alone, fit->models.end());
  std::vector<Found> found(1);
  found[0].model = static_cast<std::size_t>(alone - fit->models.begin());
  const HeldOut held = hold_out(*fit, found, std::nullopt);
  const double readings = 10;  // of 0.05 s in a row of 0.5 s
  const double noise = std::sqrt(2 / std::numbers::pi / readings) * drives.noise_w / fit->data.mean_power_w;
  EXPECT_NEAR(held.explanation / noise, 1, 0.25);
  EXPECT_LT(held.regression, held.file / 2);
  ASSERT_EQ(held.share.size(), 1u);
  // An effect that is alone in its model has nearly all of the reduction beyond the calibration.
  EXPECT_NEAR(held.share[0], 1, 0.1);
}

TEST(AtBound, IsTrueNearEndsOnly) {
  Hypothesis h;
  h.least = -2;
  h.most = 0;
  EXPECT_TRUE(at_bound(h, -1.99));
  EXPECT_FALSE(at_bound(h, -1.9));
  EXPECT_FALSE(at_bound(h, 0));  // no effect
  h.least = -std::numeric_limits<double>::infinity();
  EXPECT_FALSE(at_bound(h, -2));
}

// Groups in which the speed changes by rounding alone: v a of one block says nothing of another.
TEST(PlainRegression, IgnoresTermsOfRounding) {
  Data d;
  d.group = {0};
  d.robot.kinematics.wheel_radius_m = 1;
  for (std::size_t r = 0; r < 40; ++r) {
    Window w;
    w.block = r % 2;
    const double speed = 1 + 0.1 * static_cast<double>(r / 2);
    w.speed_rad_s = {speed, speed};
    const double a = w.block == 0 ? 1.0 : 1e-16;
    w.acceleration_rad_s2 = {a, a};
    d.rows.instants.push_back(w);
    d.rows.first.push_back(r + 1);
    d.rows.power_w.push_back(10 + 5 * speed + (r % 4 < 2 ? 0.1 : -0.1));
  }
  const Eigen::VectorXd predicted = plain_regression(d, term_columns(d), std::vector<double>{0, 1});
  EXPECT_LT((predicted - d.rows.measured_w()).cwiseAbs().maxCoeff(), 1) << predicted.transpose();
}

}  // namespace
}  // namespace joulecast::gap::posterior
