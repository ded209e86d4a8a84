#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "base/error.h"
#include "energy/initial_value_problem.h"

namespace joulecast::energy {

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

  long evaluations() const;  // of the rates, since the last restart

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace joulecast::energy
