#include "causes.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/direct/convention.hpp"
#include "device.hpp"

namespace abbe::calib::direct {
namespace {

constexpr double kRounding = 1e-12;  // a smaller difference is rounding; m or rad
constexpr double kNeverFits = std::numeric_limits<double>::infinity();
constexpr std::size_t kLeastDof = 3;
constexpr double kMostOutside = 0.3;  // largest share of the positions that a correction may move
                                      // outside the nodes of the model

/// The measured values after a correction.
struct CorrectedValues {
  std::string text;
  std::vector<double> positions_m;  // in any order
  Eigen::VectorXd values;
  std::size_t parameters = 0;  // number of parameters of the correction that are estimated from the
                               // values
};

/// The corrected values at positions that the model covers, by ascending position.
CorrectedValues covered(const ModelCurve& curve, const CorrectedValues& all) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < all.positions_m.size(); ++i) {
    if (curve.covers(all.positions_m[i])) {
      order.push_back(i);
    }
  }
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return all.positions_m[a] < all.positions_m[b]; });

  CorrectedValues out{
      all.text, {}, Eigen::VectorXd(static_cast<Eigen::Index>(order.size())), all.parameters};
  for (std::size_t i = 0; i < order.size(); ++i) {
    out.positions_m.push_back(all.positions_m[order[i]]);
    out.values(static_cast<Eigen::Index>(i)) = all.values(static_cast<Eigen::Index>(order[i]));
  }
  return out;
}

/// Tries corrections of the measured values of one table and compares the remaining differences.
class CauseSearch {
 public:
  CauseSearch(const ModelCurve& curve, std::span<const double> positions_m,
              const Eigen::VectorXd& measured, StraightnessLine line)
      : curve_(curve),
        given_{"", {positions_m.begin(), positions_m.end()}, measured, 0},
        line_(line),
        P_(reduction(curve.motion(), positions_m, curve.nodes().reference_m, line)),
        z_(P_ * measured),
        y_(P_ * curve.values(positions_m)) {
    for (const double node_m : curve.nodes().nodes_m) {
      shapes_ += node_m >= positions_m.front() && node_m <= positions_m.back() ? 1 : 0;
    }
  }

  [[nodiscard]] double rms_as_given() const { return rms(given_); }

  /// Square root of (sum of squared differences / degrees of freedom) after the correction.
  /// Infinite if too few positions remain.
  [[nodiscard]] double rms(const CorrectedValues& corrected) const {
    const CorrectedValues c = covered(curve_, corrected);
    const double least = (1.0 - kMostOutside) * static_cast<double>(given_.positions_m.size());
    const std::size_t used = conditions_of(curve_.motion()) + c.parameters;
    if (static_cast<double>(c.positions_m.size()) < least ||
        c.positions_m.size() < used + kLeastDof ||
        (c.parameters > 0 && shapes_ <= conditions_of(curve_.motion()) + c.parameters)) {
      return kNeverFits;
    }
    const Eigen::MatrixXd P =
        reduction(curve_.motion(), c.positions_m, curve_.nodes().reference_m, line_);
    const Eigen::VectorXd left = P * (c.values - curve_.values(c.positions_m));
    return std::sqrt(left.squaredNorm() / static_cast<double>(c.positions_m.size() - used));
  }

  /// True if the corrected values pass the test of the table (compare.hpp).
  [[nodiscard]] bool fits(const CorrectedValues& corrected, const CauseTest& test) const {
    const CorrectedValues c = covered(curve_, corrected);
    const Eigen::MatrixXd P =
        reduction(curve_.motion(), c.positions_m, curve_.nodes().reference_m, line_);
    const Eigen::VectorXd left = P * (c.values - curve_.values(c.positions_m));
    const double n = static_cast<double>(test.runs);
    const Eigen::VectorXd runs = test.scatter.variance / n * (P * P.transpose()).diagonal();
    const Eigen::MatrixXd B = P * curve_.rows(c.positions_m);
    const Eigen::VectorXd rest =
        curve_.covariance(B).diagonal() +
        covariance_of_device(curve_.motion(), P, c.positions_m, test.device).diagonal();

    for (Eigen::Index i = 0; i < left.size(); ++i) {
      if (std::abs(left(i)) > limit_of(test.limits, runs(i), runs(i) + rest(i)) + kRounding) {
        return false;
      }
    }
    return true;
  }

  [[nodiscard]] std::vector<CorrectedValues> corrections() const {
    std::vector<CorrectedValues> all;
    add_reversals(all);
    add_units_of_positions(all);
    add_factor(all);
    add_slope(all);
    add_shift(all);
    add_lever(all);
    return all;
  }

 private:
  void add_reversals(std::vector<CorrectedValues>& all) const {
    const std::vector<double>& nodes_m = curve_.nodes().nodes_m;
    const double both_ends_m = nodes_m.front() + nodes_m.back();
    for (const double sign : {-1.0, 1.0}) {
      CorrectedValues c = given_;
      c.values *= sign;
      if (sign < 0.0) {
        c.text = "with the sign of the values reversed";
        all.push_back(c);
      }

      const std::string also = sign < 0.0 ? " and the sign of the values reversed" : "";
      for (double& p : c.positions_m) {
        p = -p;
      }
      c.text = "with the sign of the positions reversed" + also;
      all.push_back(c);

      if (std::abs(both_ends_m) > kSameTarget_m) {
        for (double& p : c.positions_m) {
          p += both_ends_m;
        }
        c.text = "with the positions counted from the other end" + also;
        all.push_back(c);
      }
    }
  }

  /// Factors below kLeastShare are not tried: a factor that moves all positions to nearly one place
  /// would hide every difference.
  void add_units_of_positions(std::vector<CorrectedValues>& all) const {
    constexpr double kLeastShare = 0.1;  // least corrected length / length of the table
    const std::vector<double>& nodes_m = curve_.nodes().nodes_m;
    const auto [first, last] = std::ranges::minmax(given_.positions_m);
    const double least_factor = kLeastShare * (nodes_m.back() - nodes_m.front()) / (last - first);

    for (const UnitMistake& mistake : unit_mistakes()) {
      if (mistake.factor < least_factor) {
        continue;
      }
      CorrectedValues c = given_;
      for (double& p : c.positions_m) {
        p *= mistake.factor;
      }
      c.text = "with the positions as " + mistake.text;
      all.push_back(c);
    }
  }

  void add_factor(std::vector<CorrectedValues>& all) const {
    constexpr double kPlainlyNotOne = 0.15;
    const double factor = y_.squaredNorm() > 0.0 ? z_.dot(y_) / y_.squaredNorm() : 0.0;
    if (std::abs(factor - 1.0) < kPlainlyNotOne || std::abs(factor + 1.0) < kPlainlyNotOne ||
        factor == 0.0) {
      return;
    }
    CorrectedValues c = given_;
    c.values /= factor;
    c.parameters = 1;
    c.text = message("with the values divided by ", three_digits(factor),
                     " (unit or factor of the optics?)");
    all.push_back(c);
  }

  void add_slope(std::vector<CorrectedValues>& all) const {
    if (!is_positioning(curve_.motion())) {
      return;
    }
    const Eigen::Map<const Eigen::VectorXd> p(given_.positions_m.data(), z_.size());
    const Eigen::VectorXd line = P_ * p, d = z_ - y_;
    const double slope = line.dot(d) / line.squaredNorm();
    CorrectedValues c = given_;
    c.values -= slope * p;
    c.parameters = 1;
    c.text = message("after removal of ", three_digits(kUmPerM * slope),
                     " um/m (temperature of the scales, wavelength or scale of the device?)");
    all.push_back(c);
  }

  [[nodiscard]] CorrectedValues shifted(double shift_m) const {
    CorrectedValues c = given_;
    for (double& p : c.positions_m) {
      p += shift_m;
    }
    c.parameters = 1;
    c.text = message("with ", three_digits(kMmPerM * shift_m), " mm added to the positions");
    return c;
  }

  void add_shift(std::vector<CorrectedValues>& all) const {
    constexpr int kSteps = 100, kFiner = 10;
    const double reach_m = 0.5 * (given_.positions_m.back() - given_.positions_m.front());
    double best_m = 0.0, step_m = reach_m / kSteps, least = kNeverFits;
    const auto try_at = [&](double shift_m) {
      const double left = rms(shifted(shift_m));
      if (left < least) {
        least = left;
        best_m = shift_m;
      }
    };

    for (int i = -kSteps; i <= kSteps; ++i) {
      try_at(i * step_m);
    }
    for (int round = 0; round < 2; ++round, step_m /= kFiner) {
      const double centre_m = best_m;
      for (int i = -kFiner; i <= kFiner; ++i) {
        try_at(centre_m + i * step_m / kFiner);
      }
    }
    all.push_back(shifted(best_m));
  }

  /// Error d of translation k from a constant lever l: d = (eps x l)_k, eps: rotations of the axis.
  /// For component j of l the column is eps_r (e_r x e_j)_k, r: the third direction.
  void add_lever(std::vector<CorrectedValues>& all) const {
    const ErrorMotion motion = curve_.motion();
    if (is_rotation(motion.motion)) {
      return;
    }
    const auto k = static_cast<Eigen::Index>(direction(motion.motion));
    Eigen::MatrixXd columns(z_.size(), 0);
    std::string axes;
    for (Eigen::Index j = 0; j < 3; ++j) {
      const Eigen::Index r = 3 - j - k;
      const auto turning =
          j == k ? std::nullopt : curve_.of_same_axis(kAllMotions[static_cast<std::size_t>(3 + r)]);
      if (turning) {
        const double sign = Vector3::Unit(r).cross(Vector3::Unit(j))(k);
        columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
        columns.rightCols(1) = sign * turning->values(given_.positions_m);
        axes += "xyz"[j];
      }
    }

    const Eigen::MatrixXd A = P_ * columns;
    if (columns.cols() == 0 || A.norm() == 0.0) {
      return;
    }
    const Eigen::VectorXd lever_m = A.colPivHouseholderQr().solve(z_ - y_);
    CorrectedValues c = given_;
    c.values -= columns * lever_m;
    c.parameters = static_cast<std::size_t>(columns.cols());
    c.text = "with the measured line";
    for (Eigen::Index i = 0; i < lever_m.size(); ++i) {
      c.text += message(i == 0 ? " " : ", ", three_digits(kMmPerM * lever_m(i)), " mm in ",
                        axes[static_cast<std::size_t>(i)]);
    }
    c.text += " from that of the table (rotations times levers)";
    constexpr double kLongestLever_m = 2.0;
    if (lever_m.cwiseAbs().maxCoeff() < kLongestLever_m) {
      all.push_back(c);
    }
  }

  const ModelCurve& curve_;
  CorrectedValues given_;
  StraightnessLine line_;
  Eigen::MatrixXd P_;
  Eigen::VectorXd z_, y_;   // measured values and model in the convention
  std::size_t shapes_ = 0;  // number of nodes of the model in the measured range; its curve has at
                            // most as many parameters there
};

}  // namespace

std::vector<std::string> likely_causes(const ModelCurve& curve, std::span<const double> positions_m,
                                       const Eigen::VectorXd& measured, StraightnessLine line,
                                       const std::optional<CauseTest>& test) {
  const CauseSearch search(curve, positions_m, measured, line);
  const double given = search.rms_as_given();
  if (!std::isfinite(given)) {
    return {};
  }
  const std::vector<CorrectedValues> corrections = search.corrections();
  std::vector<double> left;
  for (const CorrectedValues& c : corrections) {
    left.push_back(search.rms(c));
  }

  std::vector<std::size_t> order(corrections.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return left[a] < left[b]; });
  const char* unit = is_rotation(curve.motion().motion) ? " urad" : " um";
  std::vector<std::string> causes;
  for (const std::size_t i : order) {
    if (left[i] <= kFarBetter * given && left[i] <= kAsGoodAsBest * left[order.front()]) {
      const bool fits = test && search.fits(corrections[i], *test);
      causes.push_back(message(fits ? "fits " : "closer ", corrections[i].text, ": ",
                               three_digits(kUmPerM * left[i]), unit, " rms left of ",
                               three_digits(kUmPerM * given), unit));
    }
  }
  return causes;
}

}  // namespace abbe::calib::direct
