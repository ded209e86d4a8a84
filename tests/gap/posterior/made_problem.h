#pragma once

#include <random>

#include "gap/posterior/evidence.h"

namespace joulecast::gap::posterior::made {

// A problem of one channel with the given rows. Its columns are an accessory load and, if `two`, drag.
struct Problem {
  explicit Problem(bool two = false) {
    for (const char* id : {"accessory_load", "aerodynamic_drag"}) {
      if (catalogue.columns.size() == (two ? 2 : 1)) break;
      Hypothesis h;
      h.effect = dynamics::initial(*dynamics::find_effect(id));
      h.columns = {catalogue.columns.size()};
      h.least = -1e6;
      h.most = 1e6;
      catalogue.columns.push_back({{h.effect, 0, std::nullopt}, catalogue.hypotheses.size()});
      catalogue.hypotheses.push_back(h);
    }
    equations.effects = catalogue.columns.size();
    equations.columns.resize(equations.effects);
    equations.share = Eigen::VectorXd::Ones(ix(equations.effects));
  }

  Catalogue catalogue;
  Equations equations;
};

inline Eigen::MatrixXd normal(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> draw;
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return draw(random); });
}

}  // namespace joulecast::gap::posterior::made
