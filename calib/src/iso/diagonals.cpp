#include <string_view>

#include "iso/lines.hpp"

namespace abbe::calib::iso {
namespace {

using estimation::AxisTravel;
using estimation::Travel;

constexpr std::size_t kPointsOfDiagonal = 21;
constexpr std::array<std::string_view, 4> kDiagonals{"PPP", "NPP", "PNP", "NNP"};

/// Rows of the component of V along the diagonal, relative to that at its beginning.
Eigen::MatrixXd diagonal_rows(const ErrorFunctions& functions, const Diagonal& diagonal,
                              const AxisTravel& travel) {
  const Vector3 along = (diagonal.to_m - diagonal.from_m).normalized();
  const Eigen::RowVectorXd first = functions.row(diagonal.from_m, along);
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(diagonal.along_m.size()), first.size());
  for (std::size_t i = 0; i < diagonal.along_m.size(); ++i) {
    rows.row(static_cast<Eigen::Index>(i)) =
        functions.row(diagonal.from_m + diagonal.along_m[i] * along, along, travel) - first;
  }
  return rows;
}

Diagonal diagonal_of(const ErrorFunctions& functions, const LineBox& box, std::string_view name) {
  Diagonal d{.name = std::string(name), .from_m = box.low_m, .to_m = box.high_m};
  AxisTravel forward{}, backward{};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto i = static_cast<Eigen::Index>(a);
    const bool positive = name[a] == 'P';
    if (!positive) {
      std::swap(d.from_m(i), d.to_m(i));
    }
    forward[a] = positive ? Travel::Forward : Travel::Backward;
    backward[a] = positive ? Travel::Backward : Travel::Forward;
  }
  const double length_m = (d.to_m - d.from_m).norm();
  for (std::size_t i = 0; i < kPointsOfDiagonal; ++i) {
    d.along_m.push_back(length_m * static_cast<double>(i) / (kPointsOfDiagonal - 1.0));
  }

  const Eigen::MatrixXd mean = diagonal_rows(functions, d, {});
  for (Eigen::Index i = 0; i < mean.rows(); ++i) {
    d.mean.push_back(functions.with_u(mean.row(i)));
  }
  d.M = range_of(functions, mean);
  if (functions.has_travel()) {
    if (const auto both = bidirectional_of(functions, diagonal_rows(functions, d, forward),
                                           diagonal_rows(functions, d, backward))) {
      d.E = both->E;
      d.B = both->B;
    }
  }
  return d;
}

}  // namespace

std::array<Diagonal, 4> diagonals_of(const ErrorFunctions& functions, const LineBox& box) {
  std::array<Diagonal, 4> all;
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i] = diagonal_of(functions, box, kDiagonals[i]);
  }
  return all;
}

}  // namespace abbe::calib::iso
