#include "energy/cvode.h"

#include <cvode/cvode.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <vector>

#include "energy/sundials_problem.h"

namespace joulecast::energy {

struct Cvode::Impl : SundialsProblem {
  SUNMatrix matrix = nullptr;
  SUNLinearSolver linear = nullptr;
  SUNNonlinearSolver nonlinear = nullptr;
  void* memory = nullptr;

  Impl(std::size_t n, Method method, InitialValueProblem& of) : SundialsProblem(n, of) {
    const auto length = static_cast<sunindextype>(n);
    require((memory = CVodeCreate(method == Method::adams ? CV_ADAMS : CV_BDF, context)) != nullptr);
    require(CVodeInit(memory, &Impl::rate, 0, y) == CV_SUCCESS);
    require(CVodeSetUserData(memory, self()) == CV_SUCCESS);
    require(CVodeWFtolerances(memory, &Impl::weights) == CV_SUCCESS);
    require(CVodeSetErrHandlerFn(memory, &Impl::report, self()) == CV_SUCCESS);
    require(CVodeSetMaxNumSteps(memory, 100000) == CV_SUCCESS);
    if (problem.event_count() > 0) {
      require(CVodeRootInit(memory, static_cast<int>(problem.event_count()), &Impl::events) == CV_SUCCESS);
      require(CVodeSetNoInactiveRootWarn(memory) == CV_SUCCESS);
    }
    if (method == Method::adams) {
      require((nonlinear = SUNNonlinSol_FixedPoint(y, 0, context)) != nullptr);
      require(CVodeSetNonlinearSolver(memory, nonlinear) == CV_SUCCESS);
    } else {
      require((matrix = SUNDenseMatrix(length, length, context)) != nullptr);
      require((linear = SUNLinSol_Dense(y, matrix, context)) != nullptr);
      require(CVodeSetLinearSolver(memory, linear, matrix) == CV_SUCCESS);
    }
  }

  ~Impl() {
    if (memory != nullptr) CVodeFree(&memory);
    if (nonlinear != nullptr) SUNNonlinSolFree(nonlinear);
    if (linear != nullptr) SUNLinSolFree(linear);
    if (matrix != nullptr) SUNMatDestroy(matrix);
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

  // Restarts at t0 and integrates towards t1; the flag distinguishes an event from the end.
  Result<int> run(double t0, double t1, double first_step, double& reached) {
    if (!(t1 > t0)) return invalid("t1", "must be after t0");
    message.clear();
    if (Result<void> ok = check(CVodeReInit(memory, t0, y)); !ok) return tl::unexpected(ok.error());
    if (Result<void> ok = check(CVodeSetInitStep(memory, first_step)); !ok) return tl::unexpected(ok.error());
    if (Result<void> ok = check(CVodeSetStopTime(memory, t1)); !ok) return tl::unexpected(ok.error());
    reached = t0;
    const int flag = CVode(memory, t1, y, &reached, CV_NORMAL);
    if (Result<void> ok = check(flag); !ok) return tl::unexpected(ok.error());
    if (flag != CV_ROOT_RETURN && reached != t1)
      return fail(Fault::internal, "cvode",
                  "stopped at " + std::to_string(reached) + " s, short of its goal");
    return flag;
  }
};

Cvode::Cvode(std::size_t size, Method method, InitialValueProblem& problem)
    : impl_(std::make_unique<Impl>(size, method, problem)) {}
Cvode::~Cvode() = default;
Cvode::Cvode(Cvode&&) noexcept = default;
Cvode& Cvode::operator=(Cvode&&) noexcept = default;

std::span<double> Cvode::state() {
  return Impl::values(impl_->y);
}

Result<void> Cvode::advance(double t0, double t1, double first_step) {
  double from = t0;
  for (;;) {  // events are passed over
    double reached = from;
    const Result<int> flag = impl_->run(from, t1, first_step, reached);
    if (!flag) return tl::unexpected(flag.error());
    if (*flag != CV_ROOT_RETURN || reached == t1) return {};
    from = reached;
  }
}

Result<Arrival> Cvode::advance_to_event(double t0, double t1, double first_step) {
  double reached = t0;
  const Result<int> flag = impl_->run(t0, t1, first_step, reached);
  if (!flag) return tl::unexpected(flag.error());
  if (*flag != CV_ROOT_RETURN) return Arrival{reached, std::nullopt};
  std::vector<int> signs(impl_->problem.event_count());
  CVodeGetRootInfo(impl_->memory, signs.data());
  const auto changed = std::find_if(signs.begin(), signs.end(), [](int sign) { return sign != 0; });
  return Arrival{reached, static_cast<std::size_t>(changed - signs.begin())};
}

void Cvode::limit_step(double longest) {
  Impl::require(CVodeSetMaxStep(impl_->memory, longest) == CV_SUCCESS);
}

long Cvode::steps() const {
  long count = 0;
  CVodeGetNumSteps(impl_->memory, &count);
  return count;
}

long Cvode::evaluations() const {
  long count = 0;
  CVodeGetNumRhsEvals(impl_->memory, &count);
  return count;
}

}  // namespace joulecast::energy
