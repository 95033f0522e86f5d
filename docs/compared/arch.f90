! The clamped arch under its own weight as a boundary value problem on 0 <= s <= 1:
! x' = cos θ, y' = sin θ, θ' = κ, κ' = -4π² (q s cos θ + λ sin θ - μ cos θ), λ' = μ' = 0, s' = 1.
! Parameters: 1 q, 2 Theta, 3 Delta; the span is that of the circular arc at Theta = 1.

subroutine func(ndim, u, icp, par, ijac, f, dfdu, dfdp)
  implicit none
  integer, intent(in) :: ndim, icp(*), ijac
  double precision, intent(in) :: u(ndim), par(*)
  double precision, intent(out) :: f(ndim)
  double precision, intent(inout) :: dfdu(ndim, *), dfdp(ndim, *)
  double precision, parameter :: pi = 3.14159265358979324d0
  f(1) = cos(u(3))
  f(2) = sin(u(3))
  f(3) = u(4)
  f(4) = -4 * pi**2 * (par(1) * u(7) * cos(u(3)) + u(5) * sin(u(3)) - u(6) * cos(u(3)))
  f(5:6) = 0
  f(7) = 1
end subroutine func

subroutine stpnt(ndim, u, par, s)
  implicit none
  integer, intent(in) :: ndim
  double precision, intent(inout) :: u(ndim), par(*)
  double precision, intent(in) :: s
  par(1:3) = (/ 0d0, 1d0, 0d0 /)
  u = (/ (sin(1d0) - sin(1 - 2 * s)) / 2, (cos(1 - 2 * s) - cos(1d0)) / 2, 1 - 2 * s, &
         -2d0, 0d0, 0d0, s /)
end subroutine stpnt

subroutine bcnd(ndim, par, icp, nbc, u0, u1, fb, ijac, dbc)
  implicit none
  integer, intent(in) :: ndim, icp(*), nbc, ijac
  double precision, intent(in) :: par(*), u0(ndim), u1(ndim)
  double precision, intent(out) :: fb(nbc)
  double precision, intent(inout) :: dbc(nbc, *)
  fb = (/ u0(1), u0(2), u0(3) - par(3) - par(2), u0(7), &
          u1(1) - sin(1d0), u1(2), u1(3) - par(3) + par(2) /)
end subroutine bcnd

subroutine icnd
end subroutine icnd

subroutine fopt
end subroutine fopt

subroutine pvls
end subroutine pvls
