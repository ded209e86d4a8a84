#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/catalogue.h"
#include "gap/equations/families.h"
#include "gap/equations/hypothesis.h"
#include "gap/equations/shapes.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// What one robot's recordings come to before anything is decided.
struct Material {
  const robot::RobotModel& robot;
  std::span<const dynamics::ActiveEffect> adopted;  // effects of the robot file, always in force
  std::span<const Window> windows;
  std::size_t blocks = 0;
  FromMotion from_motion;
  double row_s = 0;                           // between rows of the recordings
  std::span<const std::string> covariates{};  // names, in the order of Window::covariates
  double prior_factor = 1;                    // on tolerances and scatter
};

// A chosen cause in the coordinates of its hypothesis: (strength), or for slope (angle cos, angle sin).
struct Chosen {
  std::size_t hypothesis = 0;
  std::vector<double> coefficients;
};

// All regressors of one diagnosis of recordings, linearised where the chosen effects put the model.
class ColumnSet {
 public:
  // `shares`: of the mean power, that an effect which is there may move; hypotheses come once for each.
  ColumnSet(const Material& material, const Shapes& shapes, std::span<const double> shares);

  // Differentiates around these from now on, at first around none; in covariates everything is linear anyway.
  void linearise_around(std::span<const Chosen> chosen);

  // The columns of effects other than these stay zero from now on, until it is linearised anew.
  void differentiate_only(std::span<const std::string_view> effects);

  std::size_t size() const { return columns_.size(); }
  const std::vector<Column>& columns() const { return columns_; }
  const std::vector<Hypothesis>& hypotheses() const { return hypotheses_; }
  const Ranges& ranges() const { return ranges_; }
  const FromMotion& from_motion() const { return from_motion_; }
  double mean_power_w() const { return mean_power_w_; }

  // What was chosen, with its strengths within their bounds; functions outside the catalogue are left out.
  std::vector<Cause> causes_of(std::span<const Chosen> chosen) const;

  // Where a cause stands among the hypotheses: the variant with its shapes, or nothing.
  std::optional<Chosen> coordinates_of(const Cause& cause) const;

  // Responses of one window: values[channel] = residual at the linearisation point plus what the chosen
  // coefficients explain, rows(column, channel) the derivatives of the modelled reading. Both NaN / 0 where
  // the channel does not speak. `rows` has size() * channel_count values, column-major by channel.
  void evaluate(const Window& w, ChannelValues<double>& values, std::span<double> rows) const;

 private:
  struct Derivative {  // column -> model to differentiate
    std::size_t column;
    dynamics::BasicDriveModel<dynamics::Dual> model;
  };
  void add_effects(const Shapes& shapes, std::span<const double> shares);
  void add_covariates(const Material& material, std::span<const double> shares);
  void add_nuisances();
  void add_families(std::span<const double> shares);
  void measure(std::span<const Window> windows);
  void scale_effects(std::span<const double> shares);
  void scale_covariates(std::span<const double> shares);
  void scale_families(std::span<const double> shares);

  robot::RobotModel robot_;
  std::vector<dynamics::ActiveEffect> adopted_;
  Ranges ranges_;
  FromMotion from_motion_;
  double row_s_;
  double mean_power_w_ = 0, mean_motor_power_w_ = 0;
  double torque_power_w_ = 0,
         voltage_power_w_ = 0;  // of the battery for 1 N m at each wheel, for 1 V on each motor
  std::vector<Column> columns_;
  std::vector<dynamics::ActiveEffect> column_effect_;  // of effect columns
  std::vector<std::size_t> column_parameter_;
  struct Followed {  // a column that is another one times a covariate
    std::size_t column, carrier;
    Modulation by;
  };
  std::vector<Followed> followed_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<OutsideFamily> families_;
  std::vector<std::size_t> family_first_;
  std::size_t first_nuisance_ = 0;
  std::vector<Derivative> derivatives_;
  std::vector<dynamics::DriveModel> base_;  // one
  std::vector<double> offset_;              // chosen coefficients by column
};

}  // namespace joulecast::gap
