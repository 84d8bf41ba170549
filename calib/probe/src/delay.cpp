#include "abbe/calib/probe/delay.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/student_tail.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::probe {
namespace {

constexpr std::size_t kLeastFeeds = 3;
constexpr std::size_t kLeastTouchesPerFeed = 3;  // a variance from two touches is too uncertain

/// All touches of one feed.
struct Feed {
  double speed_m_s = 0.0;
  double along_m = 0.0;
  double variance_m2 = 0.0;  ///< variance of one touch
  double count = 0.0;
};

Result<void> check(std::span<const FeedTouch> touches) {
  for (const FeedTouch& t : touches) {
    if (!std::isfinite(t.speed_m_s) || !std::isfinite(t.along_m))
      return failure(ErrorCode::NotFinite, "probe delay: a touch is not finite");
    if (!(t.speed_m_s > 0.0))
      return failure(ErrorCode::BadInput,
                     message("probe delay: feed ", t.speed_m_s, " m/s, must be greater than 0"));
  }
  return {};
}

Feed feed_of(std::span<const FeedTouch> touches) {
  Feed f{.count = static_cast<double>(touches.size())};
  for (const FeedTouch& t : touches) {
    f.speed_m_s += t.speed_m_s / f.count;
    f.along_m += t.along_m / f.count;
  }
  for (const FeedTouch& t : touches) {
    const double d = t.along_m - f.along_m;
    f.variance_m2 += d * d / std::max(1.0, f.count - 1.0);
  }
  return f;
}

Result<std::vector<Feed>> group(std::span<const FeedTouch> touches, const DelayOptions& options) {
  std::vector<FeedTouch> sorted(touches.begin(), touches.end());
  std::ranges::sort(sorted, {}, &FeedTouch::speed_m_s);
  std::vector<Feed> feeds;

  for (std::size_t begin = 0, end = 0; begin < sorted.size(); begin = end) {
    const double most = sorted[begin].speed_m_s / (1.0 - options.same_feed);
    while (end < sorted.size() && sorted[end].speed_m_s <= most) ++end;
    if (end - begin < kLeastTouchesPerFeed) {
      return failure(
          ErrorCode::TooFewObservations,
          message("probe delay: ", end - begin, " touches at ", sorted[begin].speed_m_s * 1e3,
                  " mm/s, at least ", kLeastTouchesPerFeed, " are needed at each feed"));
    }
    feeds.push_back(feed_of(std::span{sorted}.subspan(begin, end - begin)));
  }

  return feeds;
}

/// s0^2 and s_tau^2, neither negative, such that s0^2 + v^2 s_tau^2 best fits the variances of the
/// positions at each feed v.
struct Scatter {
  double s0_m2 = 0.0;
  double jitter_s2 = 0.0;
};

/// One weighted fit of the variances at the feeds. The weights are computed from the variances that
/// follow from `guess`, because the standard deviation of an estimated variance is proportional to
/// the true variance.
Scatter refined(const std::vector<Feed>& feeds, const Scatter& guess) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  double pooled = 0.0;
  double sum = 0.0;

  for (const Feed& f : feeds) {
    const double v2 = f.speed_m_s * f.speed_m_s;
    const double expected = std::max(guess.s0_m2 + v2 * guess.jitter_s2, 1e-30);
    const double weight = (f.count - 1.0) / (expected * expected);
    const Eigen::Vector2d row{1.0, v2};
    normal += weight * row * row.transpose();
    right += weight * f.variance_m2 * row;
    pooled += weight * f.variance_m2;
    sum += weight;
  }

  const Eigen::Vector2d scale = normal.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::Matrix2d scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::Vector2d scaled_right = scale.cwiseProduct(right);
  const Eigen::Vector2d solved = scaled.fullPivLu().solve(scaled_right);
  const Eigen::Vector2d both = scale.cwiseProduct(solved);
  if (both.allFinite() && both[0] >= 0.0 && both[1] >= 0.0) return {both[0], both[1]};
  if (!both.allFinite() || both[1] < 0.0) return {pooled / sum, 0.0};

  return {0.0, right[1] / normal(1, 1)};
}

Scatter scatter_of(const std::vector<Feed>& feeds) {
  constexpr int kRounds = 5;
  Scatter scatter;
  for (const Feed& f : feeds) scatter.s0_m2 += f.variance_m2 / static_cast<double>(feeds.size());
  for (int i = 0; i < kRounds; ++i) scatter = refined(feeds, scatter);
  return scatter;
}

}  // namespace

Result<ProbeDelayFit> fit_delay(std::span<const FeedTouch> touches, const DelayOptions& options) {
  ABBE_TRY(check(touches));
  const auto feeds = group(touches, options);
  ABBE_TRY(feeds);
  if (feeds->size() < kLeastFeeds) {
    return failure(
        ErrorCode::TooFewObservations,
        message("probe delay: ", feeds->size(), " feeds, at least ", kLeastFeeds, " are needed"));
  }
  const double ratio = feeds->back().speed_m_s / feeds->front().speed_m_s;
  if (ratio < options.min_feed_ratio) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("probe delay: the fastest feed is ", ratio,
                           " times the slowest, at least ", options.min_feed_ratio, " is needed"));
  }

  const Scatter scatter = scatter_of(*feeds);
  // The line is fitted relative to the mean position and speed of the feeds, so that no digits are
  // lost if positions are far from the origin.
  double sum_w = 0.0;
  double mean_v = 0.0;
  double mean_p = 0.0;
  const double origin = feeds->front().along_m;
  const auto weight = [&](const Feed& f) {
    const double variance = scatter.s0_m2 + f.speed_m_s * f.speed_m_s * scatter.jitter_s2;
    // The variance is taken as at least (1 fm)^2, because simulated touches may have no scatter.
    return f.count / std::max(variance, 1e-30);
  };
  for (const Feed& f : *feeds) {
    sum_w += weight(f);
    mean_v += weight(f) * f.speed_m_s;
    mean_p += weight(f) * (f.along_m - origin);
  }

  mean_v /= sum_w;
  mean_p /= sum_w;
  double vv = 0.0;
  double vp = 0.0;

  for (const Feed& f : *feeds) {
    vv += weight(f) * (f.speed_m_s - mean_v) * (f.speed_m_s - mean_v);
    vp += weight(f) * (f.speed_m_s - mean_v) * (f.along_m - origin - mean_p);
  }

  ProbeDelayFit fit{.delay_s = vp / vv, .u_delay_s = 1.0 / std::sqrt(vv)};
  fit.u_jitter_s = std::sqrt(scatter.jitter_s2);
  fit.u_scatter_m = std::sqrt(scatter.s0_m2);
  fit.origin_m = origin + mean_p - fit.delay_s * mean_v;
  fit.feeds = feeds->size();
  fit.touches = touches.size();

  for (const Feed& f : *feeds) {
    const double residual = f.along_m - fit.origin_m - fit.delay_s * f.speed_m_s;
    fit.lack_of_fit += weight(f) * residual * residual / static_cast<double>(feeds->size() - 2);
  }

  // With a lack of fit, u_delay_s is estimated from the feeds' mean residuals, which are few.
  fit.dof = static_cast<double>(fit.lack_of_fit > 1.0 ? fit.feeds - 2 : fit.touches - fit.feeds);
  fit.u_delay_s *= std::sqrt(std::max(1.0, fit.lack_of_fit)) * student_over_normal(fit.dof);
  double squares = 0.0;

  for (const FeedTouch& t : touches) {
    const double residual = t.along_m - fit.origin_m - fit.delay_s * t.speed_m_s;
    squares += residual * residual;
  }

  fit.residual_rms_m = std::sqrt(squares / static_cast<double>(touches.size()));
  return fit;
}

}  // namespace abbe::calib::probe
