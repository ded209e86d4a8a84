#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/error.h"
#include "energy/initial_value_problem.h"

namespace joulecast::energy {

enum class Method {
  adams,  // Adams-Moulton with fixed-point iteration: smooth, non-stiff
  bdf     // BDF with a dense Newton iteration: stiff
};

struct Arrival {
  double time_s = 0;
  std::optional<std::size_t>
      event;  // the function that changed sign there; absent at the end of the interval
};

// One CVODE integrator of fixed size, restarted as often as wanted. Owns its SUNContext, so an instance
// belongs to one thread at a time.
class Cvode {
 public:
  Cvode(std::size_t size, Method method, InitialValueProblem& problem);
  ~Cvode();
  Cvode(Cvode&&) noexcept;
  Cvode& operator=(Cvode&&) noexcept;

  std::span<double> state();

  // Integrates from `t0` with the present state() to exactly `t1` > t0, restarting the method at t0;
  // `first_step` = 0 lets CVODE choose. The error carries CVODE's own message.
  Result<void> advance(double t0, double t1, double first_step = 0);

  // As advance(), but stops where one of the problem's event functions first changes sign. A function that
  // is zero at t0 counts from when it has left zero.
  Result<Arrival> advance_to_event(double t0, double t1, double first_step = 0);

  // Bounds every step from now on, for right-hand sides with features that error control could step over;
  // 0 lifts the bound.
  void limit_step(double longest);

  long steps() const;        // since the last restart
  long evaluations() const;  // of the right-hand side, since the last restart

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace joulecast::energy
