#include "gap/posterior/walk.h"

#include <algorithm>
#include <cmath>

#include "base/try.h"

namespace joulecast::gap::posterior {
namespace {

Eigen::VectorXd joined(const Fit& fit, const Parts& parts) {
  Eigen::VectorXd all = parts.strengths.head(ix(fit.equations.effects));
  for (std::size_t k = 0; k < fit.equations.effects; ++k)
    if (fit.equations.columns[k].of_file) all[ix(k)] += parts.calibration[ix(k)];
  return bounded(fit.catalogue, std::move(all));
}

double power_share(const Fit& fit, const Eigen::VectorXd& of_columns) {
  if (!fit.data.power) return 0;
  const Eigen::VectorXd strengths = of_columns.head(ix(fit.equations.effects));
  return (fit.equations.moved * strengths).cwiseAbs().mean() / fit.data.mean_power_w;
}

// The sensor delay of the likeliest model.
double sensor_delay_s(const Fit& fit) {
  const std::size_t best = likeliest(fit);
  const std::vector<std::size_t>& set = fit.models[best].set;
  for (std::size_t k = 0; k < set.size(); ++k)
    if (fit.catalogue.hypotheses[set[k]].id() == "sensor_delay") return fit.strengths[best].mean[ix(k)];
  return 0;
}

}  // namespace

Fit::Fit(Data recordings)
    : data(std::move(recordings)), catalogue(make_catalogue(data)), functions(make_functions(data)) {}

void infer(Fit& fit) {
  fit.noise.clear();
  for (const ChannelRows& rows : fit.equations.channels)
    fit.noise.push_back(learn_noise(rows, fit.equations, fit.functions));
  fit.grams = make_grams(fit.equations, fit.noise, fit.data.blocks);
  fit.reduced = reduce(fit.equations, fit.grams, fit.once());
  fit.prior = std::make_unique<Prior>(fit.catalogue, fit.equations, fit.functions, fit.gap, !fit.data.motors,
                                      weighted_sum(fit.grams.raw, fit.once()).xx);
  fit.models = enumerate(*fit.prior, fit.reduced[0]);
  fit.plain = probabilities(*fit.prior, fit.reduced, fit.models);
  fit.factor = fit.plain.best_factor;
  log_posteriors(View(*fit.prior, fit.reduced[fit.factor]), fit.reduced[fit.factor], fit.models,
                 &fit.strengths);
}

Eigen::VectorXd power_of(const Fit& fit, const Eigen::VectorXd& strengths) {
  const Equations& e = fit.equations;
  return fit.linear ? Eigen::VectorXd(e.modelled_w + e.moved * (strengths - e.point))
                    : power_at(fit.data, fit.catalogue, e, strengths);
}

Eigen::VectorXd calibration(const Equations& e, const Information& blocks, double factor,
                            const Eigen::VectorXd& coefficients) {
  const Eigen::VectorXd all = tolerances(e, factor);
  std::vector<Eigen::Index> own;
  for (Eigen::Index k = 0; k < all.size(); ++k)
    if (all[k] > 0) own.push_back(k);
  const Eigen::VectorXd sd = all(own);
  Eigen::MatrixXd m = sd.asDiagonal() * blocks.xx(own, own) * sd.asDiagonal();
  m.diagonal().array() += 1;
  const Eigen::VectorXd rest =
      blocks.xy(own) - blocks.xx(own, Eigen::seqN(0, coefficients.size())) * coefficients;
  Eigen::VectorXd out = Eigen::VectorXd::Zero(all.size());
  out(own) = sd.cwiseProduct(m.llt().solve(sd.cwiseProduct(rest)));
  return out;
}

std::size_t likeliest(const Fit& fit) {
  Eigen::Index best = 0;
  fit.plain.log_joint.maxCoeff(&best);
  return ux(best);
}

Parts parts_of(const Fit& fit) {
  const std::size_t best = likeliest(fit);
  Eigen::VectorXd own = View(*fit.prior, fit.reduced[fit.factor])
                            .coefficients(fit.models[best].set, fit.strengths[best].mean, std::nullopt);
  Eigen::VectorXd with = calibration(fit.equations, weighted_sum(fit.grams.of_factor[fit.factor], fit.once()),
                                     tolerance_factors[fit.factor], own);
  return {std::move(own), std::move(with)};
}

double missed(const Data& data, const Eigen::VectorXd& power_w) {
  return (data.rows.measured_w() - power_w).cwiseAbs().mean() / data.mean_power_w;
}

Step damped_step(const Fit& fit, const Eigen::VectorXd& target, std::span<const double> weights) {
  const Eigen::VectorXd& point = fit.equations.point;
  const PowerRows& rows = fit.data.rows;
  const Eigen::VectorXd measured = rows.measured_w();
  Step best;
  for (const double length : step_lengths) {
    Step step;
    step.strengths = point + length * (target - point);
    step.power_w = power_of(fit, step.strengths);
    double sum_w = 0, count = 0;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      const double weight = weights[rows.window(r).block];
      sum_w += weight * std::fabs(measured[ix(r)] - step.power_w[ix(r)]);
      count += weight;
    }
    if (std::isfinite(sum_w)) step.missed = sum_w / count / fit.data.mean_power_w;
    if (best.power_w.size() == 0 || step.missed < best.missed) best = std::move(step);
  }
  return best;
}

std::unique_ptr<Fit> walk(Data recordings, const std::function<bool()>& goes_on) {
  auto fit = std::make_unique<Fit>(std::move(recordings));
  Eigen::VectorXd point = Eigen::VectorXd::Zero(ix(fit->catalogue.columns.size()));
  fit->gap = 1;
  if (fit->data.power) {
    fit->unchanged_w = predicted_power(fit->data, fit->data.in_file);
    fit->gap = missed(fit->data, fit->unchanged_w);
  }
  std::vector<std::size_t> last_set;
  Parts last;
  for (fit->steps = 0;; ++fit->steps) {
    if (goes_on && !goes_on()) return nullptr;
    fit->prior.reset();
    fit->equations = linearise(fit->data, fit->catalogue, fit->functions, point);
    infer(*fit);
    const std::vector<std::size_t> set = fit->models[likeliest(*fit)].set;
    const Parts now = parts_of(*fit);
    double explained = power_share(*fit, now.calibration);
    // Of battery power, or of the motors' where an effect moves that more.
    for (std::size_t k = 0; k < fit->equations.effects; ++k)
      explained += std::fabs(now.strengths[ix(k)]) / fit->equations.columns[k].unit;
    if (fit->steps + 1 >= most_steps || explained < near_file) break;
    if (fit->steps > 0 && set == last_set &&
        (now.strengths - last.strengths).cwiseAbs().maxCoeff() <
            settled * std::max(now.strengths.cwiseAbs().maxCoeff(), 1e-12) &&
        power_share(*fit, now.calibration - last.calibration) < settled_power)
      break;
    last_set = set;
    last = now;
    const Eigen::VectorXd target = joined(*fit, now);
    // Where only the motors' power is measured, their own rows contain it already.
    if (!fit->data.power || (fit->data.motors && !fit->data.rows.meter.empty())) {
      point = target;
      continue;
    }
    Step step = damped_step(*fit, target, fit->once());
    if (!(step.missed < improved * missed(fit->data, power_of(*fit, point)))) break;
    point = std::move(step.strengths);
  }
  return fit;
}

Result<std::unique_ptr<Fit>> fit_missions(std::span<const telemetry::Recording> missions,
                                          const robot::RobotModel& robot,
                                          const std::function<bool()>& goes_on) {
  std::unique_ptr<Fit> fit;
  double taken_out_s = 0;
  for (int round = 0; round < most_delay_rounds; ++round) {
    TRY_ASSIGN(Data data, make_data(missions, robot, taken_out_s));
    fit = walk(std::move(data), goes_on);
    if (!fit) break;
    const double found_s = sensor_delay_s(*fit);
    if (std::fabs(found_s - taken_out_s) < settled_delay_s) break;
    taken_out_s = found_s;
  }
  return fit;
}

}  // namespace joulecast::gap::posterior
