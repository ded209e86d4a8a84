#pragma once

#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "energy/initial_value_problem.h"

namespace joulecast::energy {

// An initial value problem with its state in SUNDIALS' terms: what the integrators of cvode.cc and erk.cc
// have in common.
struct SundialsProblem {
  InitialValueProblem& problem;
  SUNContext context = nullptr;
  N_Vector y = nullptr;
  std::string message;  // of the library's last error

  SundialsProblem(std::size_t size, InitialValueProblem& of) : problem(of) {
    require(SUNContext_Create(nullptr, &context) == 0);
    require((y = N_VNew_Serial(static_cast<sunindextype>(size), context)) != nullptr);
    N_VConst(0, y);
  }
  ~SundialsProblem() {
    if (y != nullptr) N_VDestroy(y);
    if (context != nullptr) SUNContext_Free(&context);
  }
  SundialsProblem(const SundialsProblem&) = delete;
  SundialsProblem& operator=(const SundialsProblem&) = delete;

  void* self() { return this; }  // the user data of the callbacks below

  // Construction fails only without memory or by our own misuse of the library.
  static void require(bool ok) {
    if (!ok) std::abort();
  }

  static std::span<double> values(N_Vector v) {
    return {N_VGetArrayPointer(v), static_cast<std::size_t>(N_VGetLength(v))};
  }

  static int rate(sunrealtype t, N_Vector y, N_Vector ydot, void* self) {
    const std::span<double> out = values(ydot);
    static_cast<SundialsProblem*>(self)->problem.rate(t, values(y), out);
    return finite(out);
  }

  // An integrator would retry a NaN hundreds of times: refuse it as unrecoverable.
  static int finite(std::span<const double> rates) {
    return std::ranges::all_of(rates, [](double v) { return std::isfinite(v); }) ? 0 : -1;
  }

  static int weights(N_Vector y, N_Vector weight, void* self) {
    static_cast<SundialsProblem*>(self)->problem.weights(values(y), values(weight));
    return 0;
  }

  static void report(int, const char*, const char*, char* text, void* self) {
    static_cast<SundialsProblem*>(self)->message = text;
  }
};

}  // namespace joulecast::energy
