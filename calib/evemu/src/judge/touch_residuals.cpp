#include "abbe/calib/internal/evemu/judge/touch_residuals.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/statistics/chi2_bound.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "judge/false_touch.hpp"
#include "observe/feature_residuals.hpp"

namespace abbe::calib::evemu {
namespace {

/// Finding for the ball or face whose touches scatter most, if they scatter significantly more than
/// sigma_m.
std::optional<TouchFinding> worst_form(const Observations& o,
                                       const std::vector<FeatureResiduals>& all, double sigma_m,
                                       double false_alarm) {
  const FeatureResiduals* worst = nullptr;
  double excess = 0.0;
  for (const FeatureResiduals& f : all) {
    const double chi2 = f.r_m.squaredNorm() / (sigma_m * sigma_m);
    if (chi2 - f.dof() > excess) {
      worst = &f, excess = chi2 - f.dof();
    }
  }

  const double x = natural_logarithm(static_cast<double>(all.size()) / false_alarm);
  if (worst == nullptr || !(excess + worst->dof() > chi2_bound(worst->dof(), x))) {
    return std::nullopt;
  }

  const double rms_m = std::sqrt(worst->r_m.squaredNorm() / std::max(1.0, worst->dof()));
  return TouchFinding{
      .cause = Cause::Form,
      .text = message(place_of(o, *worst), ": its touches scatter by ", rms_m * kUmPerM,
                      " um, those of other features by ", sigma_m * kUmPerM,
                      " um: the array moved while it was touched, or its surface is dirty"),
      .log_likelihood = 0.5 * excess,
      .rows_m = {}};
}

/// Negative logarithm of an upper bound of the probability that a of the a + b degrees of freedom
/// of white noise have more than the fraction `share` of the sum of squares (Chernoff's bound of
/// the beta distribution). 0 if `share` is below its mean.
double minus_log_tail(double share, double a, double b) {
  const double mean = a / (a + b);
  if (!(share > mean && share < 1.0)) {
    return 0.0;
  }
  return 0.5 * (a * natural_logarithm(mean / share) +
                b * natural_logarithm((1.0 - mean) / (1.0 - share)));
}

/// Sum of squares of the residuals of one ball or face, and the degrees of freedom of this sum.
struct FormSquares {
  const FeatureResiduals* of;
  double m2, dof;
};

/// FormSquares of a ball or face. An error in the slopes of the model's V deforms a ball into an
/// ellipsoid; this deformation is removed from the residuals, too. nullopt if no degree of freedom
/// remains.
std::optional<FormSquares> form_squares(const FeatureResiduals& f) {
  if (f.feature == Feature::Block) {
    return f.dof() > 0.0 ? std::optional(FormSquares{&f, f.r_m.squaredNorm(), f.dof()})
                         : std::nullopt;
  }

  constexpr Eigen::Index kUnknowns = 9;  // radius, three coordinates of the centre, five strains
  if (f.r_m.size() <= kUnknowns) {
    return std::nullopt;
  }

  const auto x = f.normals.col(0).array(), y = f.normals.col(1).array(),
             z = f.normals.col(2).array();
  Eigen::MatrixXd design(f.r_m.size(), kUnknowns);
  design << Eigen::VectorXd::Ones(f.r_m.size()), f.normals, (x * y).matrix(), (y * z).matrix(),
      (z * x).matrix(), (x * x - y * y).matrix(), (z * z).matrix();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(design);
  const Eigen::VectorXd left = f.r_m - design * qr.solve(f.r_m);

  return FormSquares{&f, left.squaredNorm(), static_cast<double>(f.r_m.size() - qr.rank())};
}

/// Compares the k features that scatter most with the others, for every k from 2. With white noise
/// of any size, the share of k given features in the sum of squares follows the beta distribution;
/// the probability is multiplied by the number of ways to choose k features. Balls and faces are
/// compared separately, because backlash and lobing of the probe enlarge the scatter of balls only.
std::optional<TouchFinding> form_of_several(const Observations& o,
                                            const std::vector<FeatureResiduals>& all, Feature kind,
                                            double false_alarm) {
  std::vector<FormSquares> sorted;
  double total_m2 = 0.0, total_dof = 0.0;
  for (const FeatureResiduals& f : all) {
    if (const auto squares = f.feature == kind ? form_squares(f) : std::nullopt) {
      sorted.push_back(*squares);
      total_m2 += squares->m2;
      total_dof += squares->dof;
    }
  }

  std::stable_sort(sorted.begin(), sorted.end(), [](const FormSquares& a, const FormSquares& b) {
    return a.m2 * b.dof > b.m2 * a.dof;
  });

  const auto count = static_cast<double>(sorted.size());
  double m2 = 0.0, dof = 0.0, k = 0.0, log_choices = 0.0,
         most = natural_logarithm(count / false_alarm);
  std::optional<TouchFinding> found;

  for (const FormSquares& f : sorted) {
    log_choices += natural_logarithm((count - k) / (k + 1.0));
    k += 1.0;
    m2 += f.m2;
    dof += f.dof;
    const double beyond_choice = minus_log_tail(m2 / total_m2, dof, total_dof - dof) - log_choices;
    if (k < 2.0 || !(beyond_choice > most)) {
      continue;
    }
    most = beyond_choice;
    found = TouchFinding{
        .cause = Cause::Form,
        .text =
            message("touches of ", k, kind == Feature::Ball ? " balls" : " block faces",
                    " scatter by ", std::sqrt(m2 / dof) * kUmPerM, " um, those of the others by ",
                    std::sqrt((total_m2 - m2) / (total_dof - dof)) * kUmPerM,
                    " um, most of all at ", place_of(o, *sorted.front().of),
                    ": the array or balls moved while they were touched, or surfaces are dirty"),
        .log_likelihood = beyond_choice,
        .rows_m = {}};
  }

  return found;
}

/// Backlash of axis a is a vector b_a: the difference of the positions at the same reading before
/// and after the axis reverses. A touch against the outward normal n then lies farther out by
///     sum_a sign(n_a) b_a . n / 2.
/// Column 3 a + m: component m of b_a. An axis that hardly moves on the way to the touch does not
/// contribute, because its direction of motion is uncertain.
constexpr Eigen::Index kBacklashes = 9;
constexpr double kLeastMotion = 0.1;  // least component of the unit normal along the axis

Eigen::MatrixXd along_of_backlash(const FeatureResiduals& f) {
  Eigen::MatrixXd along(f.normals.rows(), kBacklashes);
  for (Eigen::Index a = 0; a < 3; ++a) {
    const Eigen::ArrayXd n_a = f.normals.col(a).array();
    const Eigen::ArrayXd side = (n_a.abs() > kLeastMotion).select(n_a.sign(), 0.0);
    for (Eigen::Index m = 0; m < 3; ++m) {
      along.col(3 * a + m) = 0.5 * side * f.normals.col(m).array();
    }
  }
  return along;
}

/// Effect of backlash on the residuals of a ball.
Eigen::MatrixXd residuals_of_backlash(const FeatureResiduals& ball) {
  const Eigen::MatrixXd along = along_of_backlash(ball);
  Eigen::MatrixXd design(along.rows(), 4);
  design << ball.normals, Eigen::VectorXd::Ones(along.rows());
  return along - design * (ball.response * along);
}

struct Backlash {
  Eigen::VectorXd b_m = Eigen::VectorXd::Zero(kBacklashes);
  double drop = 0.0;    ///< decrease of chi2; 0: not significant
  double dof = 0.0;     ///< effective number of unknowns that the touches determine
  bool across = false;  ///< includes components perpendicular to the axes
};

/// Estimates the components of backlash in `columns`, from the normal equations N b = g. Their
/// prior has mean 0 and a standard deviation of 100 um, more than the backlash of a sound axis.
/// Components that the touches hardly distinguish from radius and position of a ball therefore stay
/// near zero.
Backlash backlash_of(const std::vector<Eigen::Index>& columns, const Eigen::MatrixXd& N,
                     const Eigen::VectorXd& g, double sigma_m) {
  constexpr double kPrior_m = 100e-6;
  const double least = (sigma_m / kPrior_m) * (sigma_m / kPrior_m);
  const Eigen::MatrixXd N_columns = N(columns, columns);
  const Eigen::VectorXd g_columns = g(columns);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(N_columns);
  const Eigen::ArrayXd shown = eigen.eigenvalues().array().max(0.0);
  const Eigen::ArrayXd along = (eigen.eigenvectors().transpose() * g_columns).array();
  const Eigen::VectorXd b = eigen.eigenvectors() * (along / (shown + least)).matrix();
  Backlash found{.drop = g_columns.dot(b) / (sigma_m * sigma_m),
                 .dof = (shown / (shown + least)).sum()};
  found.b_m(columns) = b;
  return found;
}

/// Backlash with components along the axes; with perpendicular components, too, if these explain
/// significantly more.
Backlash significant_backlash(const std::vector<FeatureResiduals>& all, double sigma_m,
                              double false_alarm) {
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(kBacklashes, kBacklashes);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(kBacklashes);
  for (const FeatureResiduals& f : all) {
    if (f.feature == Feature::Ball) {
      const Eigen::MatrixXd left = residuals_of_backlash(f);
      N += left.transpose() * left;
      g += left.transpose() * f.r_m;
    }
  }

  const double x = natural_logarithm(2.0 / false_alarm);
  Backlash along = backlash_of({0, 4, 8}, N, g, sigma_m);
  if (!(along.drop > chi2_bound(along.dof, x))) {
    along = {};
  }

  Backlash across = backlash_of({0, 1, 2, 3, 4, 5, 6, 7, 8}, N, g, sigma_m);
  across.across = true;
  return across.drop - along.drop > chi2_bound(across.dof - along.dof, x) ? across : along;
}

std::vector<FeatureResiduals> without(const Backlash& backlash, std::vector<FeatureResiduals> all) {
  for (FeatureResiduals& f : all) {
    if (backlash.drop > 0.0 && f.feature == Feature::Ball) {
      f.r_m -= residuals_of_backlash(f) * backlash.b_m;
    }
  }
  return all;
}

TouchFinding finding_of(const Backlash& backlash, const Observations& o,
                        const std::vector<FeatureResiduals>& all) {
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * o.rows.size()));
  for (const FeatureResiduals& f : all) {
    if (f.feature == Feature::Ball) {
      rows += effect_m(o, f, along_of_backlash(f) * backlash.b_m);
    }
  }

  // Column a: backlash vector of axis a.
  const Matrix3 b_um = kUmPerM * Eigen::Map<const Matrix3>(backlash.b_m.data());
  const Matrix3 across_um = b_um - Matrix3(b_um.diagonal().asDiagonal());
  return {
      .cause = Cause::Backlash,
      .text = message("the touches depend on the direction of approach: backlash of X ", b_um(0, 0),
                      ", Y ", b_um(1, 1), ", Z ", b_um(2, 2), " um along the axes, up to ",
                      across_um.cwiseAbs().maxCoeff(), " um across them, or a probe with lobing"),
      .log_likelihood = 0.5 * backlash.drop,
      .rows_m = std::move(rows)};
}

std::string why_not_compared(const Observations& o, const Features& features) {
  if (o.seen.empty()) {
    return "errors were given without touches: not compared are single touches, displaced balls, "
           "an array that moved, creeps or is bent, a drift, and slow noise";
  }
  return features.compared.empty() && features.failed.empty()
             ? "single touches are not compared: no ball has 5 touches, no block 4"
             : "";
}

}  // namespace

TouchResiduals touch_residuals(const Observations& o, const VolumetricModel& model,
                               double false_alarm) {
  Features features = all_features(o, model);
  const std::vector<FeatureResiduals>& all = features.compared;
  TouchResiduals found;
  found.not_compared = why_not_compared(o, features);
  found.failed = std::move(features.failed);
  found.sigma_m = pooled_sigma_m(all);

  if (!(found.sigma_m > 0.0)) {
    return found;
  }

  found.s_centre_m = centre_noise_m(all, found.sigma_m);
  const Backlash backlash = significant_backlash(all, found.sigma_m, false_alarm);
  const std::vector<FeatureResiduals> left = without(backlash, all);
  found.sigma_of_no_cause_m = pooled_sigma_m(left);
  auto touch = false_touch(o, all, found.sigma_m, false_alarm);
  std::optional<TouchFinding> form;

  if (!touch) {  // else the scatter of a ball or block may be caused by that false touch
    form = worst_form(o, left, found.sigma_m, 0.5 * false_alarm);
    // Balls are not compared if there is backlash perpendicular to an axis: for an axis that hardly
    // moves on the way to a touch it is not removed from the residual (kLeastMotion), and it would
    // appear as scatter of several balls.
    if (!form && !backlash.across) {
      form = form_of_several(o, left, Feature::Ball, 0.25 * false_alarm);
    }
    if (!form) {
      form = form_of_several(o, left, Feature::Block, 0.25 * false_alarm);
    }
  }

  for (std::optional<TouchFinding>* finding : {&form, &touch}) {
    if (*finding) {
      found.findings.push_back(*std::move(*finding));
    }
  }

  if (backlash.drop > 0.0) {
    found.findings.push_back(finding_of(backlash, o, all));
  }

  return found;
}

}  // namespace abbe::calib::evemu
