semismooth friction rod.json | awk '{ print $1, $3, $6, $7, $8 }'
