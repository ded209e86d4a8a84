#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>

#include "base/error.h"

namespace joulecast::energy {

// The right-hand side of an initial value problem y' = f(t, y). `rate` has the size of `state`; Erk's has the
// rates of its integrals behind.
class InitialValueProblem {
 public:
  virtual ~InitialValueProblem() = default;
  virtual void rate(double t, std::span<const double> state, std::span<double> rate) = 0;
  // Error weights 1/tolerance of each state; called at every step.
  virtual void weights(std::span<const double> state, std::span<double> weight) const = 0;
  // Cvode::advance() stops where one of these functions changes sign. Their number is fixed at
  // construction.
  virtual std::size_t event_count() const { return 0; }
  virtual void events(double /*t*/, std::span<const double> /*state*/, std::span<double> /*value*/) const {}
};

struct Arrival {
  double time_s = 0;
  std::optional<std::size_t>
      event;  // the function that changed sign there; absent at the end of the interval
};

// One CVODE integrator of fixed size by Adams and Moulton with fixed-point iteration, for smooth problems
// that are not stiff, restarted as often as wanted. Owns its SUNContext, so an instance belongs to one thread
// at a time.
class Cvode {
 public:
  Cvode(std::size_t size, InitialValueProblem& problem);
  ~Cvode();
  Cvode(const Cvode&) = delete;
  Cvode& operator=(const Cvode&) = delete;

  std::span<double> state();

  // Integrates from `t0` with the present state() to exactly `t1` > t0, restarting the method at t0, or to
  // where one of the problem's event functions first changes sign. A function that is zero at t0 counts from
  // when it has left zero. The error carries CVODE's own message.
  Result<Arrival> advance(double t0, double t1);

  // Bounds every step from now on, for right-hand sides with features that error control could step over;
  // 0 lifts the bound.
  void limit_step(double longest);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// One explicit Runge-Kutta integrator of fixed size, SUNDIALS' ERKStep with Bogacki and Shampine's pair of
// order 3(2), restarted as often as wanted: a one-step method needs no start of lower order. Integrals of
// rates that do not feed back into the state are taken by the same steps and weights, without error control
// of their own. Owns its SUNContext, so an instance belongs to one thread at a time.
class Erk {
 public:
  // The problem's rates are those of `size` states, then those of `integrals` integrals.
  Erk(std::size_t size, std::size_t integrals, InitialValueProblem& problem);
  ~Erk();
  Erk(const Erk&) = delete;
  Erk& operator=(const Erk&) = delete;

  std::span<double> state();
  std::span<const double> integrals() const;  // over the last advance()

  // Integrates from `t0` with the present state() to exactly `t1` > t0, in one step where the error allows
  // it. The error carries ARKODE's own message.
  Result<void> advance(double t0, double t1);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace joulecast::energy
