#pragma once

#include <span>
#include <vector>

#include "gap/diagnose/problem.h"
#include "gap/runs/run_columns.h"

namespace joulecast::gap {

// How energies of runs scatter beside any cause, learnt from the runs themselves: from what a fit of
// everything, causes and trends alike, leaves over. Runs that repeat each other's conditions count most in
// it, since no fit can follow them.
struct RunScatter {
  double run = 0, difference = 0;  // sd relative to a run's energy: of the energy, of right minus left
  Eigen::VectorXd size_j;  // of each run, what is relative is relative to: its energy, smoothed by the fit
  Eigen::VectorXd weight;  // of each row, less for outliers; 0: left out
};
// `group` of each run: what differs between groups is no scatter; empty: all are one.
RunScatter learn_scatter(const RunColumns& columns, const std::vector<bool>& left_out = {},
                         std::span<const std::size_t> group = {});

// The block of each run: runs that follow each other in one table and in one group (empty: all are one), a
// couple of dozen blocks altogether.
std::vector<std::size_t> blocks_of(std::span<const MissionRun> runs, std::span<const std::string> groups);

// The problem that the runs come to; `response`: of each row [J], in place of the runs' own.
Problem make_problem(const RunColumns& columns, const RunScatter& scatter, std::span<const std::size_t> block,
                     const Eigen::VectorXd* response = nullptr);

}  // namespace joulecast::gap
