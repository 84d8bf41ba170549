#pragma once
/// The delay of a touch probe from touches of one surface at several feeds. The scales are read at
/// the edge, the contact was a delay earlier, so the apparent place along the approach grows with
/// the feed:
///     p_i = p0 + tau v_i + e_i,   var e_i = s0^2 + (v_i s_tau)^2
/// with the scatter s0 of probe and surface and the jitter s_tau of the delay, both estimated from the
/// scatter at each feed. Weighted least squares; pure; allocates. Lengths in m, times in s.
///
/// What is not seen: pre-travel that changes with the feed in the same way. It is compensated along
/// with the delay as long as it is linear in the feed; the test of fit shows what is not.

#include <cstddef>
#include <span>

#include "abbe/calib/error.hpp"

namespace abbe::calib::probe {

struct FeedTouch {
  double speed_m_s = 0.0;  ///< of the approach, > 0
  /// uncompensated place along the direction of the approach, from any origin
  double along_m = 0.0;
};

struct DelayOptions {
  /// Feeds that differ by less are one: what a control makes of one commanded feed. Share of the
  /// faster.
  double same_feed = 0.05;
  /// The largest feed over the smallest must reach this, else the slope is a guess.
  double min_feed_ratio = 2.0;
};

struct ProbeDelayFit {
  double delay_s = 0.0;  ///< to be added to the one the touches were compensated with
  /// Half width of the 95 % interval over 1.96: the deviation the scatter gives, times sqrt(misfit)
  /// where that exceeds 1 [Birge 1932], times Student's t for `dof` over the normal one [GUM] G.3,
  /// because either is an estimate (1.25 with nine touches; 6.5 where three feeds are not on a
  /// line).
  double u_delay_s = 0.0;
  /// what u is known from: touches - feeds, or feeds - 2 where the misfit exceeds 1
  double dof = 0.0;
  double u_jitter_s = 0.0;   ///< deviation from touch to touch
  double u_scatter_m = 0.0;  ///< deviation that does not depend on the feed
  double origin_m = 0.0;     ///< place of the surface
  double residual_rms_m = 0.0;
  /// Weighted sum of squares of the feeds' means over its degrees of freedom (feeds - 2): far above
  /// 1, the places do not lie on a line.
  double misfit = 0.0;
  std::size_t feeds = 0;
  std::size_t touches = 0;
};

/// NotFinite; BadInput for a speed that is not positive; TooFewObservations below three feeds with
/// three touches each; DegenerateGeometry for feeds too much alike.
[[nodiscard]] Result<ProbeDelayFit> fit_delay(std::span<const FeedTouch> touches,
                                              const DelayOptions& options = {});

}  // namespace abbe::calib::probe
