#pragma once
/// The delay of a touch probe, from touches of one surface at several feeds. The scales are read at
/// the signal edge, which follows the contact by the delay. The apparent position along the
/// approach therefore increases with the feed:
///     p_i = p0 + tau v_i + e_i,   var e_i = s0^2 + (v_i s_tau)^2
/// s0: scatter of probe and surface; s_tau: jitter of the delay; both are estimated from the
/// scatter at each feed. p_i: position and v_i: feed of touch i, p0: position of the surface, tau:
/// delay. Weighted least squares; pure; allocates. Lengths in m, times in s.
///
/// Pre-travel that is linear in the feed has the same effect as a delay and is compensated together
/// with the delay. Pre-travel that is not linear in the feed increases lack_of_fit.

#include <cstddef>
#include <span>

#include "abbe/calib/base/error.hpp"

namespace abbe::calib::probe {

struct FeedTouch {
  double speed_m_s = 0.0;  ///< approach feed, > 0
  /// uncompensated position along the direction of the approach, from any common origin
  double along_m = 0.0;
};

struct DelayOptions {
  /// Feeds that differ by less than this fraction of the faster one count as one feed: actual feeds
  /// scatter about one commanded feed.
  double same_feed = 0.05;
  /// Smallest ratio of the largest to the smallest feed; below it the slope is poorly determined.
  double min_feed_ratio = 2.0;
};

struct ProbeDelayFit {
  double delay_s = 0.0;  ///< to be added to the delay with which the touches were compensated
  /// Half width of the 95 % interval divided by 1.96: the standard deviation from the scatter,
  /// times sqrt(lack_of_fit) if lack_of_fit exceeds 1 [Birge 1932], times Student's t for `dof`
  /// divided by the normal quantile [GUM] G.3, because scatter and lack_of_fit are estimates
  /// (factor 1.25 with nine touches; 6.5 if three feeds do not lie on a line).
  double u_delay_s = 0.0;
  /// degrees of freedom of u_delay_s: touches - feeds, or feeds - 2 if lack_of_fit exceeds 1
  double dof = 0.0;
  double u_jitter_s = 0.0;   ///< standard deviation of the delay from touch to touch
  double u_scatter_m = 0.0;  ///< standard deviation that does not depend on the feed
  double origin_m = 0.0;     ///< position of the surface
  double residual_rms_m = 0.0;
  /// Lack of fit: weighted sum of squares of the feeds' mean residuals divided by its degrees of
  /// freedom (feeds - 2). Far above 1: the positions are not linear in the feed.
  double lack_of_fit = 0.0;
  std::size_t feeds = 0;
  std::size_t touches = 0;
};

/// Estimates the delay. NotFinite; BadInput for a speed that is not positive; TooFewObservations
/// below three feeds with three touches each; DegenerateGeometry if the feeds differ too little.
[[nodiscard]] Result<ProbeDelayFit> fit_delay(std::span<const FeedTouch> touches,
                                              const DelayOptions& options = {});

}  // namespace abbe::calib::probe
