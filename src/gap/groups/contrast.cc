#include "gap/groups/contrast.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {
namespace {

using posterior::ChannelRows;
using posterior::Equations;
using posterior::Fit;
using posterior::ix;
using posterior::ux;

constexpr double shared = 0.3;         // of the mean power: sd of each strength that groups share
constexpr double ordinary_part = 0.5;  // of the tolerance: sd of differences between groups

// The extent of the strengths that an effect may have: two groups differ by no more.
double extent(const Hypothesis& of) {
  return of.most - of.least;
}

// Builds the columns of the base's effects for each contrast, the same themselves, and its nuisances.
class Contraster {
 public:
  explicit Contraster(const Fit& base)
      : base_(base), e_(base.equations), group_(base.data.group), made_{std::make_unique<Fit>(), {}, {}} {}

  Contrasted make() {
    count_rows();
    Fit& fit = *made_.fit;
    fit.linear = true;
    fit.data = base_.data;
    make_catalogue();
    make_columns();
    for (const ChannelRows& rows : e_.channels) fit.equations.channels.push_back(expanded(rows));
    move_power();
    posterior::infer(fit);
    centre();
    posterior::infer(fit);
    return std::move(made_);
  }

 private:
  std::size_t contrasts() const { return made_.contrasts.count(); }
  // The column of a contrast of an effect of the base, and of that effect itself.
  Eigen::Index place(std::size_t contrast, std::size_t k) const { return ix(contrast * e_.effects + k); }
  Eigen::Index common(std::size_t k) const { return place(contrasts(), k); }

  void count_rows() {
    std::vector<double>& share = made_.contrasts.share;
    share.assign(1 + *std::ranges::max_element(group_), 0);
    double all = 0;
    for (const ChannelRows& rows : e_.channels)
      for (const std::size_t mission : rows.mission) share[group_[mission]] += 1, all += 1;
    for (double& s : share) s /= all;
  }

  void make_catalogue() {
    posterior::Catalogue& c = made_.fit->catalogue;
    const auto& all = base_.catalogue.hypotheses;
    for (std::size_t g = 0; g < contrasts(); ++g) {
      for (std::size_t k = 0; k < e_.effects; ++k) {
        c.columns.push_back(base_.catalogue.columns[k]);
        c.columns.back().hypothesis += g * all.size();
      }
      for (std::size_t h = 0; h < all.size(); ++h) {
        c.hypotheses.push_back(all[h]);
        Hypothesis& own = c.hypotheses.back();
        for (std::size_t& column : own.columns) column += g * e_.effects;
        own.most = extent(own);
        own.least = -own.most;
        made_.hypothesis.push_back(h);
      }
    }
    c.columns.insert(c.columns.end(), base_.catalogue.columns.begin(), base_.catalogue.columns.end());
  }

  void make_columns() {
    Equations& e = made_.fit->equations;
    e.effects = (contrasts() + 1) * e_.effects;
    e.nuisances = e_.nuisances;
    e.point = Eigen::VectorXd::Zero(ix(e.effects));
    for (std::size_t g = 0; g < contrasts(); ++g) {
      double size = 0;  // mean |contrast| over the rows
      for (std::size_t q = 0; q < made_.contrasts.share.size(); ++q)
        size += made_.contrasts.share[q] * std::fabs(made_.contrasts.of(g, q));
      for (std::size_t k = 0; k < e_.effects; ++k) {
        posterior::Column c = e_.columns[k];
        c.tolerance *= ordinary_part;
        c.scatter = 0;  // in the common column
        c.unit /= size;
        c.of_file = false;
        e.columns.push_back(c);
      }
    }
    for (std::size_t k = 0; k < e_.effects; ++k) {
      posterior::Column c = e_.columns[k];
      const Hypothesis& of = base_.catalogue.hypotheses[base_.catalogue.columns[k].hypothesis];
      c.tolerance = std::min(shared * c.unit, extent(of));
      c.of_file = false;
      e.columns.push_back(c);
    }
    e.columns.insert(e.columns.end(), e_.columns.end() - static_cast<std::ptrdiff_t>(e_.nuisances),
                     e_.columns.end());
  }

  ChannelRows expanded(const ChannelRows& rows) const {
    ChannelRows out{rows.channel, {}, {}, rows.y, rows.block, rows.mission, rows.resting};
    std::vector<Eigen::VectorXd> x;
    for (std::size_t j = 0; j < rows.columns.size(); ++j) {
      const std::size_t k = ux(rows.columns[j]);
      if (k >= e_.effects && k < e_.effects + e_.functions) continue;
      if (k >= e_.effects) {
        out.columns.push_back(rows.columns[j] + ix(made_.fit->equations.effects) -
                              ix(e_.effects + e_.functions));
        x.push_back(rows.x.col(ix(j)));
        continue;
      }
      out.y -= e_.point[ix(k)] * rows.x.col(ix(j));
      for (std::size_t g = 0; g < contrasts(); ++g) {
        out.columns.push_back(place(g, k));
        x.push_back(times_contrast(rows.x.col(ix(j)), g, [&](std::size_t r) { return rows.mission[r]; }));
      }
      out.columns.push_back(common(k));
      x.push_back(rows.x.col(ix(j)));
    }
    out.x.resize(rows.x.rows(), ix(x.size()));
    for (std::size_t j = 0; j < x.size(); ++j) out.x.col(ix(j)) = x[j];
    return out;
  }

  template <class MissionOf>
  Eigen::VectorXd times_contrast(Eigen::VectorXd column, std::size_t g, const MissionOf& mission) const {
    for (Eigen::Index r = 0; r < column.size(); ++r)
      column[r] *= made_.contrasts.of(g, group_[mission(ux(r))]);
    return column;
  }

  void move_power() {
    Equations& e = made_.fit->equations;
    const auto& rows = base_.data.rows;
    e.modelled_w = e_.modelled_w;
    e.moved.resize(e_.moved.rows(), ix(e.effects));
    e.share.resize(ix(e.effects));
    e.share.tail(ix(e_.effects)) = e_.share;
    e.moves.resize(ix(e.effects));
    e.moves.tail(ix(e_.effects)) = e_.moves;
    for (std::size_t k = 0; k < e_.effects; ++k) {
      for (std::size_t g = 0; g < contrasts(); ++g) {
        e.moved.col(place(g, k)) =
            times_contrast(e_.moved.col(ix(k)), g, [&](std::size_t r) { return rows.window(r).mission; });
        const double unit = e.columns[ux(place(g, k))].unit / e_.columns[k].unit;
        e.moves[place(g, k)] = e_.moves[ix(k)] / unit;
        e.share[place(g, k)] = base_.data.power
                                   ? e.moved.col(place(g, k)).cwiseAbs().mean() / base_.data.mean_power_w
                                   : e_.share[ix(k)] / unit;
      }
      e.moved.col(common(k)) = e_.moved.col(ix(k));
    }
    made_.fit->gap = base_.gap;
  }

  // Moves to the common causes' estimate given the likeliest differences, so that the gap contains the
  // differences alone.
  void centre() {
    Fit& fit = *made_.fit;
    Equations& e = fit.equations;
    Eigen::VectorXd own = posterior::parts_of(fit).calibration;
    own.head(ix(contrasts() * e_.effects)).setZero();
    for (ChannelRows& rows : e.channels) rows.y -= rows.x * own(rows.columns);
    e.modelled_w += e.moved * own.head(ix(e.effects));
    fit.unchanged_w = e.modelled_w;
    if (fit.data.power) fit.gap = posterior::missed(fit.data, fit.unchanged_w);
  }

  const Fit& base_;
  const Equations& e_;
  const std::vector<std::size_t>& group_;
  Contrasted made_;
};

}  // namespace

Contrasted contrast(const Fit& base) {
  return Contraster(base).make();
}

}  // namespace joulecast::gap
