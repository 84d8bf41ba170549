#include "abbe/calib/internal/sparse/convexity.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/sparse/standardise.hpp"

namespace abbe::calib::sparse {
namespace {

using Support = std::vector<Eigen::Index>;

Support union_support(const Eigen::MatrixXd& b, Eigen::Index k, const Support& kept) {
  const Eigen::Index next = std::min(k + 1, b.cols() - 1);
  Support support;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (b(kept[i], k) != 0 || b(kept[i], next) != 0)
      support.push_back(static_cast<Eigen::Index>(i));
  }
  return support;
}

double smallest_eigenvalue(const Eigen::MatrixXd& Z, const Support& support) {
  if (support.empty()) return std::numeric_limits<double>::infinity();
  const Eigen::MatrixXd Z_support = Z(Eigen::all, support);
  const Eigen::MatrixXd gram = Z_support.transpose() * Z_support / static_cast<double>(Z.rows());
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(gram, Eigen::EigenvaluesOnly)
      .eigenvalues()(0);
}

}  // namespace

Result<Convexity> convexity(const Eigen::MatrixXd& X, const Path& path) {
  if (X.cols() != path.standardised.rows()) {
    return failure(ErrorCode::BadInput, message("convexity: the design has ", X.cols(),
                                                " columns, the path ", path.standardised.rows()));
  }

  return standardise(X).map([&](const Standardised& design) {
    Convexity out{Eigen::VectorXd(path.reached()), {}};
    Support before;
    double eigenvalue = std::numeric_limits<double>::infinity();
    for (Eigen::Index k = 0; k < path.reached(); ++k) {
      Support support = union_support(path.standardised, k, design.kept);
      if (support != before) eigenvalue = smallest_eigenvalue(design.X, support);
      before = std::move(support);
      out.smallest_eigenvalue(k) = eigenvalue - concavity(path.penalty);
      if (out.smallest_eigenvalue(k) < 0 && !out.first_nonconvex) out.first_nonconvex = k;
    }
    return out;
  });
}

}  // namespace abbe::calib::sparse
