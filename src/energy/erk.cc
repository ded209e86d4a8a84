#include "energy/erk.h"

#include <arkode/arkode_erkstep.h>

#include <array>
#include <vector>

#include "energy/sundials_problem.h"

namespace joulecast::energy {

struct Erk::Impl : SundialsProblem {
  static constexpr std::size_t stages = 4;
  static constexpr int most_steps = 100'000;

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

long Erk::evaluations() const {
  long count = 0;
  ERKStepGetNumRhsEvals(impl_->memory, &count);
  return count;
}

}  // namespace joulecast::energy
