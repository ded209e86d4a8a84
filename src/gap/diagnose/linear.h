#pragma once

#include <memory>
#include <span>
#include <vector>

#include "gap/diagnose/problem.h"
#include "gap/equations/columns.h"
#include "gap/equations/noise.h"

namespace joulecast::gap {

// Everything linearised in one place, and what the data say there.
struct Linear {
  std::unique_ptr<ColumnSet> columns;
  Rows rows;
  Noise noise;
  std::vector<Chosen> around;  // what it is linearised around
};

// What some blocks say where everything is linear; the noise is learnt from them alone.
struct Equations {
  const ColumnSet& columns;
  const Rows& rows;
  const Noise& noise;
  std::vector<bool> left_out{};  // by block; empty: none is
  bool leaves_out(std::size_t block) const { return !left_out.empty() && left_out[block]; }
};

// Stretches of windows, evenly, that are enough to search by; what they find is then judged by all.
std::vector<Window> thinned(std::span<const Window> windows);

Linear linearise(const Material& material, const Shapes& shapes, std::span<const double> shares,
                 std::span<const Cause> around);

// The same in the columns of some effects alone, with a noise that is known already.
Linear linearise(const Material& material, const Shapes& shapes, std::span<const double> shares,
                 std::span<const Cause> around, std::span<const std::string_view> effects, Noise noise);

// The problem that rows come to under a noise; `response`: in place of the rows' own. `columns` must outlive
// it.
Problem make_problem(const ColumnSet& columns, const Rows& rows, const Noise& noise, std::size_t blocks,
                     const Responses* response = nullptr);

// How far the equations are from zero where a linearisation stands, as a multiple of what `noise` says of
// each channel: by sizes, not squares, so that what one window does decides nothing.
double misfit(const Linear& linear, const Noise& noise);

// Half way from one set of causes to another.
std::vector<Cause> half_way(std::span<const Cause> from, std::vector<Cause> to);

}  // namespace joulecast::gap
