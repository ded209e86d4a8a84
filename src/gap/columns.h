#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/catalogue.h"
#include "gap/method_parts.h"
#include "gap/outside.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// One regressor: how the channels answer to one coefficient, and what is expected of it beforehand.
struct Column {
  double tolerance = 0;  // sd of the coefficient in a robot that is as its file says: calibration
  double scatter = 0;    // sd between missions; 0: none
  double power_w = 0;    // mean |change of modelled battery power| for a coefficient of one [W]
};

// Something that may be there: an effect of the catalogue (one variant of its shapes), or an outside family.
struct Hypothesis {
  dynamics::ActiveEffect effect;  // strength zero; null effect: outside
  std::size_t parameter = 0;      // whose coefficient the first column has
  std::string channel, variable;  // outside only
  std::vector<std::size_t> columns;
  double expected = 1;  // sd of each coefficient if it is there
  bool nonnegative = false;
  bool one_shape = false;  // variants are one thing in other shapes; otherwise they may hold together
  double log_prior = 0;

  bool outside() const { return effect.effect == nullptr; }
  std::string id() const {
    return outside() ? "outside:" + channel + ":" + variable : std::string(effect.effect->info().id);
  }
};

// The strength that is expected of an effect where it is there, however little power that moves; nothing
// where power alone says it.
std::optional<double> usual_strength(std::string_view effect);

// A chosen effect in the coordinates of its hypothesis: (strength), or for slope (angle cos, angle sin).
struct Chosen {
  std::size_t hypothesis = 0;
  std::vector<double> coefficients;
};

struct Zone {
  double x_m = 0, y_m = 0, radius_m = 0;
};

// The shapes that effects are tried with; each is a variant of its effect.
struct Shapes {
  std::vector<Zone> zones;  // found for floor_resistance_zone
  std::vector<double> scrub_rates_rad_s{0.01, 0.03, 0.1, 0.3};
  std::vector<double> stribeck_speeds_m_s{0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4};
  std::vector<double> stribeck_exponents{1, 2};
  std::vector<double> winding_time_constants_s{heat_time_constants_s.begin(), heat_time_constants_s.end()};

  // Closer values around those of a chosen effect, `factor` apart.
  void narrow(const dynamics::ActiveEffect& effect, double wheel_radius_m, double factor);
};

// All regressors of one diagnosis, linearised where the chosen effects put the model.
class ColumnSet {
 public:
  // `power`: the motor channels are missing, so that battery power is judged from motion. `gap_share`: how
  // large the gap is beside battery power, noise taken off; formulas are trusted to a part of it.
  ColumnSet(const robot::RobotModel& robot, std::span<const Window> windows, bool power, const Shapes& shapes,
            double gap_share = 0);

  // Differentiates around these effects from now on; at first around none.
  void linearise_around(std::span<const Chosen> chosen);

  // Leaves out what a trial of the method is to do without.
  void leave_out(const MethodParts& parts);

  std::size_t size() const { return columns_.size(); }
  const std::vector<Column>& columns() const { return columns_; }
  const std::vector<Hypothesis>& hypotheses() const { return hypotheses_; }
  const Ranges& ranges() const { return ranges_; }
  bool judges_power() const { return power_; }
  double mean_power_w() const { return mean_power_w_; }

  // The effects of a choice, ready for a drive model.
  std::vector<dynamics::ActiveEffect> effects_of(std::span<const Chosen> chosen) const;

  // Where an effect stands among the hypotheses: the variant with its shapes, or nothing.
  std::optional<Chosen> coordinates_of(const dynamics::ActiveEffect& effect) const;

  // Responses of one window: values[channel] = residual at the linearisation point plus what the chosen
  // coefficients explain, columns(column, channel) the derivatives of the modelled reading. Both NaN / 0
  // where the channel does not speak. `rows` has size() * channel_count values, column-major by channel.
  void evaluate(const Window& w, ChannelValues<double>& values, std::span<double> rows) const;

 private:
  struct Derivative {  // column -> model to differentiate
    std::size_t column;
    dynamics::BasicDriveModel<dynamics::Dual> model;
  };
  void add_effect(const dynamics::Effect& effect, dynamics::EffectValues<double> values,
                  std::size_t parameter, double variants);
  void scale(std::span<const Window> windows, double gap_share);

  robot::RobotModel robot_;
  std::vector<dynamics::ActiveEffect> adopted_;  // of the robot file, always in force
  Ranges ranges_;
  bool power_;
  double mean_power_w_ = 0;
  std::vector<Column> columns_;
  std::vector<dynamics::ActiveEffect> column_effect_;  // of effect columns
  std::vector<std::size_t> column_parameter_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<OutsideFamily> families_;
  std::vector<std::size_t> family_first_;
  std::size_t first_extra_ = 0;
  std::vector<Derivative> derivatives_;
  std::vector<dynamics::DriveModel> base_;  // one
  std::vector<double> offset_;              // chosen coefficients by column
};

}  // namespace joulecast::gap
