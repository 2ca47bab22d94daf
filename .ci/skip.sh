# To be sourced: `missing NAME WHAT` fails because the tool NAME is missing, unless ALLOW_SKIP, a list with commas, names it.
missing() {
    case ",${ALLOW_SKIP:-}," in
    *",$1,"*) echo "skipped: $2: no $1" ;;
    *)
        echo "$2 needs $1, which is missing: install it, or allow that it is left out with ALLOW_SKIP=$1" >&2
        exit 8
        ;;
    esac
}
