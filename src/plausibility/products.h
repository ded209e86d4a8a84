#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace joulecast::plausibility {

// Sums of products of a few quantities by blocks of time, sufficient for regressions between them, in bounded
// memory. Blocks are independent of each other; rows are not.
class Products {
 public:
  struct Block {
    double rows = 0;
    Eigen::MatrixXd sums;   // of the products of each two quantities
    Eigen::MatrixXd noise;  // the part of the noise in them
    void join(const Block& other);
  };

  // Adds a row; ignored unless all values are finite. `noise`: independent parts of its noise, or values of
  // their size.
  void add(std::initializer_list<double> row,
           std::initializer_list<std::initializer_list<double>> noise = {});
  // Starts a new block. If there are too many, neighbours are merged and blocks become twice as long.
  void next_block();
  // Ends the last block.
  void finish();

  const std::vector<Block>& blocks() const { return blocks_; }

 private:
  Block open_;
  std::vector<Block> blocks_;
  std::size_t stride_ = 1, waited_ = 0;  // a block is ended every stride_-th time
};

// Joins neighbouring blocks; an odd last one is dropped.
template <class Block>
void halve(std::vector<Block>& blocks) {
  for (std::size_t k = 0; 2 * k + 1 < blocks.size(); ++k) {
    if (k > 0) blocks[k] = std::move(blocks[2 * k]);
    blocks[k].join(blocks[2 * k + 1]);
  }
  blocks.resize(blocks.size() / 2);
}

// The same blocks with quantity[k] + factor * quantity[j] in place of quantity[k].
std::vector<Products::Block> with_part_of(std::vector<Products::Block> blocks, Eigen::Index k, Eigen::Index j,
                                          double factor);

// A linear relation between the quantities of Products, fitted to blocks.
struct BlockFit {
  Eigen::VectorXd coefficient;
  Eigen::MatrixXd covariance;
  double freedom = 0;  // blocks less coefficients; not above 0: unknown

  bool known() const { return freedom > 0; }
  double sd(Eigen::Index k) const;
};

// Regresses quantity[y] on quantity[x...], without their noise (errors in variables). Blocks that fit far
// worse than the others are downweighted (Huber). The covariance is the jackknife over blocks (Bell and
// McCaffrey 2002), which is not too small with few blocks or dominant ones. A quantity that is 0 throughout
// leaves its own coefficient unknown. Collinear quantities, also if only after removal of one block, or too
// few blocks leave all coefficients unknown.
BlockFit fit_blocks(std::span<const Products::Block> blocks, Eigen::Index y,
                    const std::vector<Eigen::Index>& x);

// A number with its standard deviation.
struct Estimate {
  double value = std::numeric_limits<double>::quiet_NaN();
  double sd = std::numeric_limits<double>::quiet_NaN();
  double freedom = 0;

  bool known() const;
  std::array<double, 2> interval() const;  // 95 %, Student's t
  // True if the value differs from zero at 99.9 %.
  bool sure() const;
};

Estimate estimate(const BlockFit& fit, const Eigen::VectorXd& combination);
Estimate estimate(const BlockFit& fit, Eigen::Index coefficient);
Estimate operator*(const Estimate& e, double factor);

// Sum of quantity[y] over the sum of quantity[x].
Estimate ratio_of_sums(std::span<const Products::Block> blocks, Eigen::Index y, Eigen::Index x,
                       Eigen::Index one);

}  // namespace joulecast::plausibility
