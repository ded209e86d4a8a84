#pragma once

#include <cstddef>
#include <span>

namespace joulecast::energy {

// The right-hand side of an initial value problem y' = f(t, y). `rate` has the size of `state`; Erk's has the
// rates of its integrals behind.
class InitialValueProblem {
 public:
  virtual ~InitialValueProblem() = default;
  virtual void rate(double t, std::span<const double> state, std::span<double> rate) = 0;
  // Error weights 1/tolerance of each state; called at every step.
  virtual void weights(std::span<const double> state, std::span<double> weight) const = 0;
  // Functions whose sign changes Cvode::advance_to_event() stops at; their number is fixed at construction.
  virtual std::size_t event_count() const { return 0; }
  virtual void events(double /*t*/, std::span<const double> /*state*/, std::span<double> /*value*/) const {}
};

}  // namespace joulecast::energy
