#include "energy/integrators.h"

#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "base/try.h"

namespace joulecast::energy {
// An initial value problem with its state in SUNDIALS' terms: common to both integrators.
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

  // An integrator would retry a NaN hundreds of times: reject it as unrecoverable.
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

struct Cvode::Impl : SundialsProblem {
  SUNNonlinearSolver nonlinear = nullptr;
  void* memory = nullptr;

  Impl(std::size_t n, InitialValueProblem& of) : SundialsProblem(n, of) {
    require((memory = CVodeCreate(CV_ADAMS, context)) != nullptr);
    require(CVodeInit(memory, &Impl::rate, 0, y) == CV_SUCCESS);
    require(CVodeSetUserData(memory, self()) == CV_SUCCESS);
    require(CVodeWFtolerances(memory, &Impl::weights) == CV_SUCCESS);
    require(CVodeSetErrHandlerFn(memory, &Impl::report, self()) == CV_SUCCESS);
    require(CVodeSetMaxNumSteps(memory, 100000) == CV_SUCCESS);
    if (problem.event_count() > 0) {
      require(CVodeRootInit(memory, static_cast<int>(problem.event_count()), &Impl::events) == CV_SUCCESS);
      require(CVodeSetNoInactiveRootWarn(memory) == CV_SUCCESS);
    }
    require((nonlinear = SUNNonlinSol_FixedPoint(y, 0, context)) != nullptr);
    require(CVodeSetNonlinearSolver(memory, nonlinear) == CV_SUCCESS);
  }

  ~Impl() {
    if (memory != nullptr) CVodeFree(&memory);
    if (nonlinear != nullptr) SUNNonlinSolFree(nonlinear);
  }

  static int events(sunrealtype t, N_Vector y, sunrealtype* value, void* self) {
    const InitialValueProblem& of = static_cast<SundialsProblem*>(self)->problem;
    of.events(t, values(y), {value, of.event_count()});
    return 0;
  }

  Result<void> check(int flag) const {
    if (flag >= 0) return {};
    return fail(Fault::internal, "cvode",
                message.empty() ? "failed with flag " + std::to_string(flag) : message);
  }
};

Cvode::Cvode(std::size_t size, InitialValueProblem& problem) : impl_(std::make_unique<Impl>(size, problem)) {}
Cvode::~Cvode() = default;

std::span<double> Cvode::state() {
  return Impl::values(impl_->y);
}

Result<Arrival> Cvode::advance(double t0, double t1) {
  if (!(t1 > t0)) return invalid("t1", "must be after t0");
  Impl& of = *impl_;
  of.message.clear();
  TRY(of.check(CVodeReInit(of.memory, t0, of.y)));
  TRY(of.check(CVodeSetStopTime(of.memory, t1)));
  double reached = t0;
  const int flag = CVode(of.memory, t1, of.y, &reached, CV_NORMAL);
  TRY(of.check(flag));
  if (flag != CV_ROOT_RETURN && reached != t1)
    return fail(Fault::internal, "cvode", "stopped at " + std::to_string(reached) + " s, short of its goal");
  if (flag != CV_ROOT_RETURN) return Arrival{reached, std::nullopt};
  std::vector<int> signs(of.problem.event_count());
  CVodeGetRootInfo(of.memory, signs.data());
  const auto changed = std::find_if(signs.begin(), signs.end(), [](int sign) { return sign != 0; });
  return Arrival{reached, static_cast<std::size_t>(changed - signs.begin())};
}

void Cvode::limit_step(double longest) {
  Impl::require(CVodeSetMaxStep(impl_->memory, longest) == CV_SUCCESS);
}

struct Erk::Impl : SundialsProblem {
  static constexpr std::size_t stages = 4;
  static constexpr int most_steps = 1'000;  // a kink takes some twenty; more is no robot's motion

  void* memory = nullptr;
  ARKodeButcherTable table = nullptr;
  // Rates of the present step's stages. The last of an accepted step is the first of the next one; a step
  // that is rejected begins again with the second.
  std::array<std::vector<double>, stages> rates;
  std::size_t stage = 0;  // the next one
  std::vector<double> integrals;

  Impl(std::size_t size, std::size_t integral_count, InitialValueProblem& of)
      : SundialsProblem(size, of), integrals(integral_count) {
    rates.fill(std::vector<double>(size + integral_count));
    require((memory = ERKStepCreate(&Impl::rate_of_stage, 0, y, context)) != nullptr);
    require((table = ARKodeButcherTable_LoadERK(ARKODE_BOGACKI_SHAMPINE_4_2_3)) != nullptr);
    require(ERKStepSetTable(memory, table) == ARK_SUCCESS);
    require(ERKStepSetUserData(memory, self()) == ARK_SUCCESS);
    require(ERKStepWFtolerances(memory, &Impl::weights) == ARK_SUCCESS);
    require(ERKStepSetErrHandlerFn(memory, &Impl::report, self()) == ARK_SUCCESS);
  }
  ~Impl() {
    if (table != nullptr) ARKodeButcherTable_Free(table);
    if (memory != nullptr) ERKStepFree(&memory);
  }

  static int rate_of_stage(sunrealtype t, N_Vector y, N_Vector ydot, void* self) {
    Impl& of = *static_cast<Impl*>(static_cast<SundialsProblem*>(self));
    std::vector<double>& rate = of.rates[of.stage];
    of.stage = of.stage + 1 < stages ? of.stage + 1 : 1;
    of.problem.rate(t, values(y), rate);
    std::ranges::copy_n(rate.begin(), N_VGetLength(y), values(ydot).begin());
    return finite(rate);
  }

  void accept(double step) {
    const std::size_t size = rates[0].size() - integrals.size();
    for (std::size_t k = 0; k < integrals.size(); ++k) {
      double sum = 0;
      for (std::size_t s = 0; s < stages; ++s) sum += table->b[s] * rates[s][size + k];
      integrals[k] += step * sum;
    }
    rates[0].swap(rates[stages - 1]);
  }
};

Erk::Erk(std::size_t size, std::size_t integrals, InitialValueProblem& problem)
    : impl_(std::make_unique<Impl>(size, integrals, problem)) {}
Erk::~Erk() = default;

std::span<double> Erk::state() {
  return Impl::values(impl_->y);
}

std::span<const double> Erk::integrals() const {
  return impl_->integrals;
}

Result<void> Erk::advance(double t0, double t1) {
  if (!(t1 > t0)) return invalid("t1", "must be after t0");
  Impl& of = *impl_;
  of.message.clear();
  of.stage = 0;
  std::ranges::fill(of.integrals, 0.0);
  int flag = ERKStepReInit(of.memory, &Impl::rate_of_stage, t0, of.y);
  if (flag >= 0) flag = ERKStepSetInitStep(of.memory, t1 - t0);
  if (flag >= 0) flag = ERKStepSetStopTime(of.memory, t1);
  double from = t0, reached = t0;
  for (int k = 0; k < Impl::most_steps && flag >= 0 && reached < t1; ++k, from = reached) {
    flag = ERKStepEvolve(of.memory, t1, of.y, &reached, ARK_ONE_STEP);
    if (flag >= 0) of.accept(reached - from);
  }
  if (flag >= 0 && reached == t1) return {};
  return fail(Fault::internal, "erkstep",
              of.message.empty() ? "ended with flag " + std::to_string(flag) : of.message);
}

}  // namespace joulecast::energy
